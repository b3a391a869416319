//! Which component ids the configured gimbals and their managers have.
//!
//! Device 154 has manager 191, 171 has 192, 172 has 193, 173 has 194; other gimbals take the free ones in file order.

use super::problem::Problem;
use super::reader::bare;
use super::schema::Gimbal;
use crate::gimbals::gremsy::driver::Generation;
use crate::gimbals::settings::{DeviceYawFrame, Family};
use crate::manager::voice::LAST_NUMBER;

/// The managers that need no setting: ONBOARD_COMPUTER to ONBOARD_COMPUTER4.
const AUTOMATIC: [u8; 4] = [191, 192, 193, 194];

/// The component ids of gimbal devices: GIMBAL to GIMBAL6.
const DEVICES: [u8; 6] = [154, 171, 172, 173, 174, 175];

/// Why the manager of a gimbal may not have a component id, as "component … is …".
fn reserved(id: u8, gimbal: &Gimbal, presents_devices: bool) -> Option<&'static str> {
    // The manager of a gimbal that is no v2 device speaks for the device, too; but not beside one that is presented.
    let is_v1 = gimbal.gremsy_generation.as_ref().is_some_and(|known| known.value == Some(Generation::V1));
    let is_gremsy = gimbal.family.as_ref().is_some_and(|family| family.value == Family::Gremsy);
    let speaks_for_device = (speaks_through_manager(gimbal) || is_gremsy && is_v1) && !presents_devices;
    match id {
        100..=105 => Some("a camera's"),
        id if DEVICES.contains(&id) && !speaks_for_device => Some("a gimbal device's"),
        _ => None,
    }
}

/// `presents_devices`: gimbals are presented to the autopilot under the component ids of devices.
pub(super) fn check(gimbals: &[Gimbal], presents_devices: bool, problems: &mut Vec<Problem>) {
    check_managers(gimbals, presents_devices, problems);
    check_devices(gimbals, problems);
    check_numbers(gimbals, problems);
}

fn speaks_through_manager(gimbal: &Gimbal) -> bool {
    gimbal.family.as_ref().is_some_and(|family| family.value.speaks_through_manager())
}

fn may_speak_through_manager(gimbal: &Gimbal) -> bool {
    gimbal.family.as_ref().is_some_and(|family| family.value.may_speak_through_manager())
}

/// Gimbals that are no v2 devices have the device ids 1 to 6, and v1 gimbals take yaw from the vehicle's nose only.
fn check_numbers(gimbals: &[Gimbal], problems: &mut Vec<Problem>) {
    for gimbal in gimbals.iter().filter(|gimbal| speaks_through_manager(gimbal)) {
        if let Some(frame) = gimbal.device_yaw_frame.as_ref().filter(|frame| frame.value == DeviceYawFrame::Earth) {
            let found = format!("found {}, which a gimbal of this family cannot have", frame.shown);
            problems.push(frame.problem(found, "auto or vehicle"));
        }
    }
    let mut numbered = gimbals.iter().filter(|gimbal| may_speak_through_manager(gimbal));
    if let Some(family) = numbered.nth(usize::from(LAST_NUMBER)).and_then(|gimbal| gimbal.family.as_ref()) {
        let found =
            format!("found {}, a family of gimbals that may be no v2 devices, for the seventh time", family.shown);
        problems.push(family.problem(found, "at most 6 gimbals of such families"));
    }
}

fn check_managers(gimbals: &[Gimbal], presents_devices: bool, problems: &mut Vec<Problem>) {
    const EXPECTED: &str = "a component id from 7 to 255 that nobody else on the vehicle has, for example 195";
    let mut taken = Vec::new();
    for gimbal in gimbals {
        let Some(id) = &gimbal.manager_component_id else { continue };
        if let Some(owner) = reserved(id.value, gimbal, presents_devices) {
            problems.push(id.problem(format!("found {}, which is {owner} id", id.value), EXPECTED));
        } else if taken.contains(&id.value) {
            problems.push(id.problem(format!("found {}, which another gimbal's manager has", id.value), EXPECTED));
        }
        taken.push(id.value);
    }
    let free = AUTOMATIC.iter().filter(|id| !taken.contains(id)).count();
    for gimbal in gimbals.iter().filter(|gimbal| gimbal.manager_component_id.is_none()).skip(free) {
        let name = gimbal.name.as_ref().map(|name| format!(".{}", bare(&name.value))).unwrap_or_default();
        problems.push(Problem {
            place: gimbal.place.clone(),
            key: format!("gimbal{name}.manager_component_id"),
            found: "missing, and 191 to 194 are taken".to_owned(),
            expected: EXPECTED.to_owned(),
        });
    }
}

fn check_devices(gimbals: &[Gimbal], problems: &mut Vec<Problem>) {
    let managers: Vec<u8> = gimbals
        .iter()
        .filter_map(|gimbal| gimbal.manager_component_id.as_ref())
        .map(|id| id.value)
        .chain(AUTOMATIC)
        .collect();
    for (position, gimbal) in gimbals.iter().enumerate() {
        let Some(id) = &gimbal.component_id else { continue };
        if managers.contains(&id.value) {
            let found = format!("found {}, which is a manager's id", id.value);
            let free = DEVICES.iter().find(|id| !managers.contains(id)).unwrap_or(&DEVICES[0]);
            problems.push(id.problem(found, format!("the component id of the device, for example {free}")));
        }
        let same = gimbals[..position].iter().any(|earlier| {
            earlier.component_id.as_ref().is_some_and(|earlier| earlier.value == id.value)
                && share_link(earlier, gimbal)
        });
        if same {
            let found = format!("found {}, which another gimbal on this link has", id.value);
            problems.push(id.problem(found, "an id of its own, or another link"));
        }
    }
}

/// A gimbal without a link may be on any.
fn share_link(a: &Gimbal, b: &Gimbal) -> bool {
    match (&a.link, &b.link) {
        (Some(a), Some(b)) => a.value == b.value,
        _ => true,
    }
}
