//! What is said of a port on which somebody answers: who that is, and the entries for the configuration.

use std::collections::BTreeMap;

use super::party::Party;
use super::ports::Port;
use crate::bridge::settings::Role;
use crate::wire::MavId;

/// Who answered, and where.
#[derive(Debug)]
pub struct Finding {
    pub port: Port,
    pub baud: u32,
    /// Not empty.
    pub parties: BTreeMap<MavId, Party>,
}

/// The names that were given to links so far.
#[derive(Debug, Default)]
pub struct Names(Vec<String>);

impl Names {
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// `name`, or with a number behind it when that is taken.
    fn take(&mut self, name: &str) -> String {
        let others = self.0.iter().filter(|taken| taken.split('-').next() == Some(name)).count();
        let name = if others == 0 { name.to_owned() } else { format!("{name}-{}", others + 1) };
        self.0.push(name.clone());
        name
    }
}

impl Finding {
    fn role(&self) -> Role {
        let any = |is: fn(&Party) -> bool| self.parties.values().any(is);
        if any(Party::is_autopilot) {
            Role::Autopilot
        } else if any(Party::is_gimbal) {
            Role::Gimbal
        } else if any(Party::is_ground_station) {
            Role::Ground
        } else {
            Role::Peer
        }
    }

    pub fn described(&self, names: &mut Names) -> String {
        let role = self.role().name();
        let path = self.port.name.display();
        let endpoint = toml::Value::String(format!("serial:{path}:{}", self.baud));
        let parties: String = self.parties.iter().map(|(id, party)| format!("  {id}: {party}\n")).collect();
        let name = names.take(role);
        let gimbals = self.gimbal_entries(&name, names);
        format!(
            "{path}: {} baud\n{parties}\n[[link]]\nname = \"{name}\"\nrole = \"{role}\"\nendpoint = {endpoint}\n{gimbals}",
            self.baud
        )
    }

    /// An entry for each gimbal on `link`; of several, each is named by its component.
    fn gimbal_entries(&self, link: &str, names: &mut Names) -> String {
        let gimbals: Vec<_> = self.parties.iter().filter(|(_, party)| party.is_gimbal()).collect();
        let entry = |(id, party): &(&MavId, &Party)| {
            let name = names.take("camera");
            // What is in doubt the daemon finds out.
            let family = party.family().map(|family| format!("family = \"{}\"\n", family.name())).unwrap_or_default();
            let component =
                if gimbals.len() > 1 { format!("component_id = {}\n", id.component) } else { String::new() };
            format!("\n[[gimbal]]\nname = \"{name}\"\nlink = \"{link}\"\n{family}{component}")
        };
        gimbals.iter().map(entry).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of two gimbals on one line each has its component; what only beats may be of any family.
    #[test]
    fn each_gimbal_has_an_entry() {
        let mut v2 = Party::default();
        v2.is_gimbal_device = true;
        let beats = Party::beating_as_gimbal();
        let port = Port { name: "/dev/ttyUSB0".into(), device: "/dev/ttyUSB0".into() };
        let parties = [(MavId::new(1, 154), v2), (MavId::new(1, 171), beats)].into();
        let finding = Finding { port, baud: 115_200, parties };

        let entries = finding.gimbal_entries("gimbal", &mut Names::default());

        assert_eq!(
            entries,
            "\n[[gimbal]]\nname = \"camera\"\nlink = \"gimbal\"\nfamily = \"mavlink_v2\"\ncomponent_id = 154\n\
             \n[[gimbal]]\nname = \"camera-2\"\nlink = \"gimbal\"\ncomponent_id = 171\n"
        );
    }

    #[test]
    fn two_links_of_one_role_have_two_names() {
        let mut names = Names::default();
        assert_eq!(
            ["gimbal", "autopilot", "gimbal", "gimbal"].map(|name| names.take(name)),
            ["gimbal", "autopilot", "gimbal-2", "gimbal-3"]
        );
    }
}
