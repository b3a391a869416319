//! Ids and ports, which nobody else may have.

use super::*;

/// "a fifth needs `manager_component_id`".
/// Client checklist E5: "Configuring M … as 100–105 is refused", and as a device.
#[test]
fn managers_have_ids_of_their_own() {
    const EXPECTED: &str = "expected a component id from 7 to 255 that nobody else on the vehicle has, for example 195";
    let gimbals = |ids: &[Option<u8>]| -> String {
        let entry = |(number, id): (usize, &Option<u8>)| match id {
            Some(id) => format!("[[gimbal]]\nname = \"g{number}\"\nmanager_component_id = {id}\n"),
            None => format!("[[gimbal]]\nname = \"g{number}\"\n"),
        };
        ids.iter().enumerate().map(entry).collect()
    };
    let four = [None; 4];
    assert_eq!(check(&format!("{LINK}{}", gimbals(&four)), &[]).code, Some(0));
    assert_refused(
        &gimbals(&[None; 5]),
        &[&format!("c.toml:13: gimbal.g4.manager_component_id: missing, and 191 to 194 are taken; {EXPECTED}")],
    );
    assert_eq!(check(&format!("{LINK}{}", gimbals(&[None, None, None, None, Some(195)])), &[]).code, Some(0));
    assert_refused(
        &gimbals(&[Some(192), None, None, None, None]),
        &[&format!("c.toml:14: gimbal.g4.manager_component_id: missing, and 191 to 194 are taken; {EXPECTED}")],
    );
    for (id, owner) in
        [(100, "a camera's"), (105, "a camera's"), (154, "a gimbal device's"), (175, "a gimbal device's")]
    {
        assert_refused(
            &gimbals(&[Some(id)]),
            &[&format!("c.toml:7: gimbal.g0.manager_component_id: found {id}, which is {owner} id; {EXPECTED}")],
        );
    }
    assert_refused(
        &gimbals(&[Some(200), Some(200)]),
        &[&format!(
            "c.toml:10: gimbal.g1.manager_component_id: found 200, which another gimbal's manager has; {EXPECTED}"
        )],
    );
}

/// Device ids 1 to 6 are for gimbals that are no v2 devices; their manager may have the component id of a gimbal, and they
/// know no yaw from North.
#[test]
fn gimbals_that_are_no_v2_devices_have_numbers() {
    let entry = |number: usize| {
        let manager = 200 + number;
        format!("[[gimbal]]\nname = \"g{number}\"\nfamily = \"mavlink_v1\"\nmanager_component_id = {manager}\n")
    };
    let entries = |count: usize| (0..count).map(entry).collect::<String>();
    assert_eq!(check(&format!("{LINK}{}", entries(6)), &[]).code, Some(0));
    assert_refused(
        &entries(7),
        &["c.toml:31: gimbal.g6.family: found \"mavlink_v1\", a family of gimbals that may be no v2 devices, for the \
             seventh time; expected at most 6 gimbals of such families"],
    );
    let v1 = |lines: &str| format!("[[gimbal]]\nname = \"a\"\nfamily = \"mavlink_v1\"\n{lines}");
    assert_eq!(check(&format!("{LINK}{}", v1("manager_component_id = 154\n")), &[]).code, Some(0));
    assert_refused(
        &v1("device_yaw_frame = \"earth\"\n"),
        &["c.toml:8: gimbal.a.device_yaw_frame: found \"earth\", which a gimbal of this family cannot have; expected \
             auto or vehicle"],
    );
}

#[test]
fn devices_have_ids_of_their_own_on_their_link() {
    // The entry of b begins in the line after that of a.
    let two = |a: &str, b: &str| {
        let device = "component_id = 154\n";
        format!("[[gimbal]]\nname = \"a\"\n{device}{a}[[gimbal]]\nname = \"b\"\n{b}{device}")
    };
    let on_ground = "link = \"ground\"\n";
    let same = "gimbal.b.component_id: found 154, which another gimbal on this link has; expected an id of its own, or another link";
    assert_refused(&two("", ""), &[&format!("c.toml:10: {same}")]);
    // A gimbal without a link may turn out to be on the same one.
    assert_refused(&two(on_ground, ""), &[&format!("c.toml:11: {same}")]);
    assert_refused(&two(on_ground, on_ground), &[&format!("c.toml:12: {same}")]);
    let manager = "gimbal.a.component_id: found 191, which is a manager's id; expected the component id of the device, for example 154";
    assert_refused("[[gimbal]]\nname = \"a\"\ncomponent_id = 191\n", &[&format!("c.toml:7: {manager}")]);
    let own = "gimbal.a.component_id: found 154, which is a manager's id; expected the component id of the device, for example 171";
    let both = "[[gimbal]]\nname = \"a\"\nfamily = \"mavlink_v1\"\ncomponent_id = 154\nmanager_component_id = 154\n";
    assert_refused(both, &[&format!("c.toml:8: {own}")]);
    let second_link = "[[link]]\nname = \"radio\"\nrole = \"ground\"\nendpoint = \"udpin:0.0.0.0:14551\"\n";
    let apart = two(on_ground, "link = \"radio\"\n");
    assert_eq!(check(&format!("{LINK}{second_link}{apart}"), &[]).code, Some(0));
}

#[test]
fn two_links_cannot_share_a_port() {
    #[rustfmt::skip]
    let rows = [
        ("udpin:0.0.0.0:14550",    "udpin:127.0.0.1:14550",  Some("the port of the link in line 4; expected a port of its own")),
        ("udpin:10.0.0.1:14550",   "udpin:127.0.0.1:14550",  None),
        ("udpin:0.0.0.0:14550",    "tcpin:0.0.0.0:14550",    None),
        ("udpin:127.0.0.1:0",      "udpin:127.0.0.1:0",      None),
        ("tcpin:[::]:5760",        "tcpin:0.0.0.0:5760",     Some("the port of the link in line 4; expected a port of its own")),
        ("serial:/dev/ttyX:57600", "serial:/dev/ttyX:9600",  Some("the serial port of the link in line 4; expected a serial port of its own")),
        ("serial:/dev/null:57600", "serial:/dev/./null:1200", Some("the serial port of the link in line 4; expected a serial port of its own")),
        ("serial:/dev/ttyX:57600", "serial:/dev/ttyY:57600", None),
        ("udpout:10.0.0.1:14550",  "udpout:10.0.0.1:14550",  Some("the peer of the link in line 4; expected a peer of its own")),
        ("udpout:10.0.0.1:14550",  "udpout:10.0.0.1:14551",  None),
        ("udpin:0.0.0.0:14550",    "udpout:127.0.0.1:14550", Some("the port of the link in line 4; expected the port of another program at one end")),
        ("tcpout:127.0.0.1:5760",  "tcpin:127.0.0.1:5760",   Some("the peer of the link in line 4; expected the port of another program at one end")),
        ("udpin:0.0.0.0:14550",    "udpout:10.0.0.1:14550",  None),
        ("udpin:10.0.0.1:14550",   "udpout:127.0.0.1:14550", None),
    ];
    for (first, second, problem) in rows {
        let text = format!("{}{}", LINK.replace("udpin:0.0.0.0:14550", first), {
            LINK.replace("ground\"\nrole", "second\"\nrole").replace("udpin:0.0.0.0:14550", second)
        });
        let outcome = check(&text, &[]);
        match problem {
            Some(problem) => {
                let line = format!("c.toml:8: link.second.endpoint: found \"{second}\", {problem}");
                assert_eq!(outcome, refused(&[&line]));
            }
            None => assert_eq!((outcome.code, outcome.errors.as_str()), (Some(0), ""), "{first} {second}"),
        }
    }
    let page = "c.toml:4: link.ground.endpoint: found \"tcpin:0.0.0.0:8080\", the port of http.listen; expected a port of its own";
    assert_eq!(check(&LINK.replace("udpin:0.0.0.0:14550", "tcpin:0.0.0.0:8080"), &[]), refused(&[page]));
}

/// "Bad input gets a clear error": whoever opens the multiplexer finds a pseudo-terminal where nobody is, and no gimbal ever.
#[test]
fn a_link_leads_to_a_line() {
    for path in ["/dev/ptmx", "/dev/../dev/ptmx"] {
        let text = LINK.replace("udpin:0.0.0.0:14550", &format!("serial:{path}:115200"));
        let problem = format!(
            "c.toml:4: link.ground.endpoint: found \"serial:{path}:115200\": what makes pseudo-terminals, where no gimbal can \
             be; expected a serial port such as /dev/ttyUSB0"
        );
        assert_eq!(check(&text, &[]), refused(&[&problem]));
    }
    // It may come.
    let text = LINK.replace("udpin:0.0.0.0:14550", "serial:/dev/ttyUSB77:115200");
    assert_eq!(check(&text, &[]).code, Some(0));
}
