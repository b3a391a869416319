//! The shape of the code: which folders are pure, and that imports point one way.

use std::fs;
use std::path::{Path, PathBuf};

/// Modules without time, sockets and runtime, and what each may import besides itself.
const PURE: [(&str, &[&str]); 11] = [
    ("timestamp", &[]),
    ("timers", &["timestamp"]),
    ("channel", &[]),
    ("wire", &["timestamp", "timers"]),
    ("geometry", &["timestamp"]),
    ("vehicle", &["geometry", "wire", "timestamp", "timers"]),
    ("router", &["channel", "wire", "timestamp", "timers"]),
    ("gimbals", &["vehicle", "geometry", "wire", "timestamp", "timers"]),
    ("manager", &["channel", "gimbals", "vehicle", "geometry", "wire", "timestamp", "timers"]),
    ("bridge", &["manager", "gimbals", "router", "vehicle", "geometry", "wire", "channel", "timestamp", "timers"]),
    ("sim/vehicle", &["sim", "vehicle", "geometry", "wire", "timestamp", "timers"]),
];

/// "pure: no tokio, no `std::net`, no `Instant`, no `SystemTime`".
const IMPURE: [&str; 5] = ["tokio", "net", "Instant", "SystemTime", "socket2"];

/// "`wire`, `geometry`, `router`, `gimbals`, `manager`, `bridge` and `sim/vehicle.rs` are pure".
#[test]
fn pure_modules_name_no_runtime_no_sockets_and_no_clock() {
    let mut found = Vec::new();
    for (file, code) in PURE.iter().flat_map(|(module, _)| sources(module)) {
        for (number, line) in code.lines().enumerate() {
            if let Some(word) = words(line).find(|word| IMPURE.contains(word)) {
                found.push(format!("{}:{}: {word}", file.display(), number + 1));
            }
        }
    }
    assert_eq!(found, Vec::<String>::new());
}

/// "Imports point one way: `geometry`, `wire` ← `vehicle` ← `gimbals` ← `manager` ← `bridge` ← `daemon`; `wire` ←
/// `router` ← `bridge`."
#[test]
fn imports_point_one_way() {
    let mut found = Vec::new();
    for (module, allowed) in PURE {
        for (file, code) in sources(module) {
            for (number, line) in code.lines().enumerate() {
                for import in line.split("crate::").skip(1).filter_map(|rest| words(rest).next()) {
                    let tool = import == "sim" && is_simulated_device(&file);
                    if import != module && !allowed.contains(&import) && !tool {
                        found.push(format!("{}:{}: {module} imports {import}", file.display(), number + 1));
                    }
                }
            }
        }
    }
    assert_eq!(found, Vec::<String>::new());
}

/// The two tests above see what they are to see.
#[test]
fn the_sources_are_found_and_comments_and_tests_are_left_out() {
    let files: Vec<PathBuf> = sources("wire").into_iter().map(|(file, _)| file).collect();
    assert!(files.contains(&PathBuf::from("src/wire.rs")), "{files:?}");
    assert!(files.contains(&PathBuf::from("src/wire/decoder.rs")), "{files:?}");

    let files: Vec<PathBuf> = sources("gimbals").into_iter().map(|(file, _)| file).collect();
    assert!(files.contains(&PathBuf::from("src/gimbals/parameters/list.rs")), "{files:?}");
    // They are there, and are none of them.
    for tests in ["src/gimbals/parameters/tests.rs", "src/gimbals/parameters/tests/any_gimbal.rs"] {
        assert!(Path::new(env!("CARGO_MANIFEST_DIR")).join(tests).exists(), "{tests}");
        assert!(!files.contains(&PathBuf::from(tests)), "{tests}");
    }

    let code = production("use std::net::IpAddr; // tokio\n//! Instant\n#[cfg(test)]\nmod tests { SystemTime }");
    let seen: Vec<&str> = words(&code).filter(|word| IMPURE.contains(word)).collect();
    assert_eq!(seen, ["net"]);
}

/// "Devices live in `gimbals/<family>/sim.rs`", and use what all simulated peers have in common.
fn is_simulated_device(file: &Path) -> bool {
    file.starts_with("src/gimbals")
        && file.components().any(|part| matches!(part.as_os_str().to_str(), Some("sim" | "sim.rs")))
}

fn words(code: &str) -> impl Iterator<Item = &str> {
    code.split(|letter: char| !letter.is_alphanumeric() && letter != '_').filter(|word| !word.is_empty())
}

/// The files of `module` (`module.rs` and everything in `module/`) as path and code.
fn sources(module: &str) -> Vec<(PathBuf, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut waiting = vec![PathBuf::from(format!("src/{module}.rs")), PathBuf::from(format!("src/{module}"))];
    let mut files = Vec::new();
    while let Some(path) = waiting.pop() {
        if path.ends_with("tests") {
            continue;
        }
        if let Ok(entries) = fs::read_dir(root.join(&path)) {
            waiting.extend(entries.map(|entry| path.join(entry.expect("a readable folder").file_name())));
        } else if path.extension().is_some_and(|extension| extension == "rs") && !path.ends_with("tests.rs") {
            // A module without a folder, or one that is not there (yet), has no such file.
            if let Ok(text) = fs::read_to_string(root.join(&path)) {
                files.push((path, production(&text)));
            }
        }
    }
    files.sort();
    files
}

/// Code without comments and without the tests at its end; line numbers stay.
fn production(text: &str) -> String {
    let code = text.split("#[cfg(test)]").next().unwrap_or_default();
    code.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}
