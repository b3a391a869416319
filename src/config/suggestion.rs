//! "Did you mean …?"

/// What is longer is no slip, and comparing it takes memory for the product of both lengths.
const LONGEST: usize = 64;

/// The candidate that `found` most likely was meant to be, ignoring case; `None` when nothing is close.
pub(super) fn closest<'a>(found: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let length = found.chars().count();
    if length > LONGEST {
        return None;
    }
    candidates
        .into_iter()
        // What one is longer than the other is the least distance, and known without comparing.
        .filter(|candidate| length.abs_diff(candidate.chars().count()) <= tolerated(length, candidate))
        .map(|candidate| (distance(&found.to_lowercase(), &candidate.to_lowercase()), candidate))
        .filter(|(distance, candidate)| *distance <= tolerated(length, candidate) && *distance < length)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
}

/// The greatest distance between a slip of so many characters and what was meant.
fn tolerated(length: usize, candidate: &str) -> usize {
    (length.max(candidate.chars().count()) / 3).max(1)
}

/// `; did you mean …?`, or nothing.
pub(super) fn hint<'a>(found: &str, candidates: impl IntoIterator<Item = &'a str>) -> String {
    closest(found, candidates).map(|word| format!("; did you mean {word}?")).unwrap_or_default()
}

/// Letters to insert, delete, replace, or swap with their neighbour, to make one word from the other.
fn distance(from: &str, to: &str) -> usize {
    let (from, to): (Vec<char>, Vec<char>) = (from.chars().collect(), to.chars().collect());
    let mut rows = vec![(0..=to.len()).collect::<Vec<usize>>()];
    for i in 1..=from.len() {
        let mut row = vec![i];
        for j in 1..=to.len() {
            let replaced = rows[i - 1][j - 1] + usize::from(from[i - 1] != to[j - 1]);
            let mut best = replaced.min(rows[i - 1][j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && from[i - 1] == to[j - 2] && from[i - 2] == to[j - 1] {
                best = best.min(rows[i - 2][j - 2] + 1);
            }
            row.push(best);
        }
        rows.push(row);
    }
    rows[from.len()][to.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_of_the_finger_is_recognised_and_another_word_is_not() {
        let roles = ["gimbal", "autopilot", "ground", "peer"];
        for (found, meant) in [
            ("grund", Some("ground")),
            ("gimabl", Some("gimbal")),
            ("Autopilot", Some("autopilot")),
            ("autpilott", Some("autopilot")),
            ("per", Some("peer")),
            ("camera", None),
            ("", None),
            ("x", None),
        ] {
            assert_eq!(closest(found, roles), meant, "{found}");
        }
    }

    #[test]
    fn the_closest_of_several_wins() {
        assert_eq!(closest("udpot", ["udpin", "udpout", "tcpout"]), Some("udpout"));
    }
}
