//! Whether a gimbal was restarted, as its own clock shows.

use std::ops::Range;

/// How far back a time since boot jumps, in milliseconds, when its device was restarted: further than messages overtake each
/// other, and less than it seems to jump where the field of 32 bits starts again at 0, after 49.7 days.
const RESTART_STEPS_MS: Range<u32> = 1_001..1 << 31;

/// The time since boot that a gimbal told last (`time_boot_ms`).
#[derive(Clone, Copy, Debug, Default)]
pub struct BootClock(Option<u32>);

impl BootClock {
    /// It tells its time; true when it was restarted since it told the last one.
    pub fn handle_time(&mut self, boot_ms: u32) -> bool {
        let before = self.0.replace(boot_ms);
        before.is_some_and(|before| RESTART_STEPS_MS.contains(&before.wrapping_sub(boot_ms)))
    }

    /// It is gone, and what comes next is not compared.
    pub fn forget(&mut self) {
        self.0 = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// "When the device's time_boot_ms jumps back by > 1 s" it was restarted; "clock jump of time_boot_ms (wrap at 2^32)"
    /// (gimbals 5.2) is none.
    #[test]
    #[rustfmt::skip]
    fn a_jump_back_is_a_restart_and_a_wrap_is_none() {
        for (before,          after,     is_restarted) in [
            (90_000_u32,      90_100,    false),
            (90_000,          90_000,    false),
            // One message has overtaken another.
            (90_000,          89_000,    false),
            (90_000,          88_999,    true),
            (90_000,          0,         true),
            (u32::MAX,        0,         false),
            (u32::MAX - 40,   59,        false),
            // Told after the wrap, and measured before it.
            (59,              u32::MAX,  false),
        ] {
            let mut clock = BootClock::default();
            assert!(!clock.handle_time(before), "it has told nothing before");
            assert_eq!(clock.handle_time(after), is_restarted, "{before} {after}");
            assert!(!clock.handle_time(after.wrapping_add(100)), "it is told once");
            clock.forget();
            assert!(!clock.handle_time(0));
        }
    }
}
