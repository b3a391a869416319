//! Whether everything that was configured works.

use serde::Serialize;

use crate::bridge::snapshot::Snapshot;

/// The content of `/readyz`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Readiness {
    pub ready: bool,
    /// What is missing, a phrase for each; empty exactly when ready.
    pub reasons: Vec<String>,
}

impl Readiness {
    /// Ready when every link is up and every configured gimbal is alive; one that was only found may go away again.
    pub fn of(snapshot: &Snapshot) -> Self {
        let links = snapshot.links.iter().filter(|link| link.state != "up").map(|link| match &link.reason {
            Some(reason) => format!("link {} is {}: {reason}", link.name, link.state),
            None => format!("link {} is {}", link.name, link.state),
        });
        let gimbals = snapshot.gimbals.iter().filter(|gimbal| gimbal.configured && gimbal.state != "alive");
        let gimbals = gimbals.map(|gimbal| format!("gimbal {} is {}", gimbal.name, gimbal.condition()));
        Self::for_reasons(links.chain(gimbals).collect())
    }

    /// The core does not say how things stand.
    pub fn unknown(why: &str) -> Self {
        Self::for_reasons(vec![why.to_owned()])
    }

    fn for_reasons(reasons: Vec<String>) -> Self {
        Self { ready: reasons.is_empty(), reasons }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bridge::snapshot::{GimbalSnapshot, LinkSnapshot};

    fn link(name: &str, state: &str, reason: Option<&str>) -> LinkSnapshot {
        let reason = reason.map(str::to_owned);
        LinkSnapshot { name: name.into(), state: state.into(), reason, ..LinkSnapshot::default() }
    }

    fn gimbal(name: &str, state: &str) -> GimbalSnapshot {
        GimbalSnapshot { name: name.into(), configured: true, state: state.into(), ..GimbalSnapshot::default() }
    }

    /// "200 when every configured link is up and every configured gimbal is alive, else 503 with the reasons".
    #[test]
    fn every_link_and_gimbal_that_is_missing_is_named() {
        let mut snapshot = Snapshot {
            links: vec![link("autopilot", "up", None)],
            gimbals: vec![gimbal("camera", "alive")],
            ..Snapshot::default()
        };
        assert_eq!(Readiness::of(&snapshot), Readiness { ready: true, reasons: vec![] });

        snapshot.links.push(link("gimbal", "down", Some("no such device")));
        snapshot.links.push(link("ground", "down", None));
        snapshot.gimbals.push(gimbal("lamp", "searching"));
        snapshot.gimbals.push(gimbal("radar", "lost"));
        for (name, state) in [("winch", "lost"), ("mast", "alive")] {
            let mut shut_down = gimbal(name, state);
            shut_down.details.stage = Some("shut_down".to_owned());
            snapshot.gimbals.push(shut_down);
        }
        let reasons = vec![
            "link gimbal is down: no such device".to_owned(),
            "link ground is down".to_owned(),
            "gimbal lamp is searching".to_owned(),
            "gimbal radar is lost".to_owned(),
            "gimbal winch is shut down".to_owned(),
        ];
        assert_eq!(Readiness::of(&snapshot), Readiness { ready: false, reasons });
    }

    #[test]
    fn a_daemon_without_links_and_gimbals_has_nothing_to_wait_for() {
        assert_eq!(Readiness::of(&Snapshot::default()), Readiness { ready: true, reasons: vec![] });
    }
}
