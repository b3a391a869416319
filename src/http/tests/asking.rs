//! Control over HTTP: "control needs the token of `[http] token_file`; reading does not".

use super::*;
use crate::actions::{ACTIONS, Action, CONFIRM, Kind};
use crate::gimbals::operation::{Motors, Operation, OperationError};
use crate::manager::asked::{NotDone, UNCONFIRMED};
use crate::manager::request::Refusal;
use crate::wire::MavId;
use crate::wire::ids::CommandResult;

const TOKEN: &str = "0123456789abcdef";
const STOP: &str = "/api/v1/gimbals/camera/stop";

fn with_token(outcome: Outcome) -> Window {
    let limits = Limits { body: Duration::from_millis(300), ..Limits::default() };
    Window::controlled(Some(canned::snapshot()), Some(TOKEN.parse().expect("a token")), outcome, limits)
}

impl Window {
    /// `headers` stand each on a line of its own.
    fn post(&self, path: &str, headers: &str, body: &str) -> Answer {
        let length = body.len();
        self.ask(&format!(
            "POST {path} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\nContent-Length: {length}\r\n{headers}\r\n{body}",
            self.address
        ))
    }

    /// With everything as it should be.
    fn order(&self, path: &str, body: &str) -> Answer {
        self.post(path, &format!("Authorization: Bearer {TOKEN}\r\nContent-Type: application/json\r\n"), body)
    }

    fn nothing_was_asked(&self) {
        assert!(self.asked.try_recv().is_err(), "the core was asked");
    }
}

/// "401/403 without or with the wrong token", and nothing reaches the core.
#[test]
fn who_has_no_token_controls_nothing() {
    let window = with_token(Ok(()));
    for (headers, status) in [
        ("", 401),
        ("Authorization: Basic MDEyMzQ1Njc4OWFiY2RlZg==\r\n", 401),
        ("Authorization: 0123456789abcdef\r\n", 401),
        ("Authorization: Bear\r\n", 401),
        ("Authorization: Bearer 0123456789abcdef\r\nAuthorization: Bearer 0123456789abcdef\r\n", 401),
        ("Authorization: Bearer\r\n", 401),
        ("Authorization: Bearer  \r\n", 401),
        ("Authorization: Bearer 0123456789abcdeF\r\n", 403),
        ("Authorization: Bearer 0123456789abcde\r\n", 403),
        ("Authorization: Bearer 0123456789abcdef0\r\n", 403),
        ("Authorization: Bearer 0123456789abcdef, Bearer x\r\n", 403),
        ("Authorization: Bearer \u{e4}\u{f6}\r\n", 403),
        ("Cookie: token=0123456789abcdef\r\n", 401),
    ] {
        let answer = window.post(STOP, headers, "");
        assert_eq!((answer.status, answer.header("access-control-allow-origin")), (status, None), "{headers:?}");
        assert_eq!(answer.header("www-authenticate"), (status == 401).then_some("Bearer"), "{headers:?}");
        assert!(answer.json()["error"].is_string());
    }
    let in_path = window.post(&format!("{STOP}?token={TOKEN}"), "", "");
    assert_eq!(in_path.status, 401);
    window.nothing_was_asked();
    for scheme in ["Bearer", "bearer", "BEARER"] {
        assert_eq!(window.post(STOP, &format!("Authorization: {scheme} {TOKEN}\r\n"), "").status, 200);
        assert_eq!(window.asked.try_recv(), Ok(("camera".to_owned(), Asked::Stop)));
    }
}

/// "Without it nothing can be controlled over HTTP."
#[test]
fn without_a_token_file_nothing_is_controlled() {
    let window = Window::of(canned::snapshot());
    let answer = window.order(STOP, "");
    let error = "nothing can be controlled over HTTP here: name a file with a token in [http] token_file";
    assert_eq!((answer.status, answer.json()), (403, json!({"error": error})));
    window.nothing_was_asked();
}

/// "One table in code from which routes, CLI and docs agree": every row of it is a path.
#[test]
fn every_action_has_its_path() {
    let window = with_token(Ok(()));
    for action in ACTIONS {
        let (in_path, body) = example(action);
        let path = format!("/api/v1/gimbals/camera/{}", action.path_with(in_path.as_deref()));

        let answer = window.order(&path, &body);

        let done = json!({"gimbal": "camera", "done": action.command});
        assert_eq!((answer.status, answer.json()), (200, done), "{path} {body}");
        let asked = action.read(in_path.as_deref(), body.as_bytes()).expect("an example");
        assert_eq!(window.asked.try_recv(), Ok(("camera".to_owned(), asked)));
        for method in ["PUT", "DELETE", "PATCH", "OPTIONS", "TRACE"] {
            let request = format!(
                "{method} {path} HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {TOKEN}\r\nConnection: close\r\n\r\n"
            );
            let answer = window.ask(&request);
            assert_eq!(answer.status, 405, "{method} {path}");
            assert!(answer.header("allow").is_some_and(|allow| allow.contains("POST")), "{method} {path}");
        }
    }
    window.nothing_was_asked();
}

/// A right value for every field, and its word.
pub fn example(action: &Action) -> (Option<String>, String) {
    let value = |kind: Kind| match kind {
        Kind::Number { max, .. } => json!(max.min(7.0)),
        Kind::Word(words) => json!(words[0]),
        Kind::WholeOrWord { max, .. } => json!(max),
        Kind::Flag => json!(true),
        Kind::Name { .. } => json!("PWR_PAN"),
    };
    let mut body: serde_json::Map<String, Value> =
        action.body_fields().map(|field| (field.name.to_owned(), value(field.kind))).collect();
    if let Some(word) = action.word() {
        body.insert(CONFIRM.to_owned(), word.into());
    }
    let in_path = action.path_field().map(|field| value(field.kind).as_str().expect("text").to_owned());
    (in_path, Value::Object(body).to_string())
}

/// "Dangerous ones need an explicit word in the body"; "422/400 what was wrong and what was expected".
#[test]
fn what_is_wrong_with_a_body_is_said() {
    let window = with_token(Ok(()));
    for (path, body, status, error) in [
        (
            "motors",
            r#"{"state": "off"}"#,
            422,
            "this is dangerous: the camera falls to where its weight takes it; to a Gremsy that speaks v2 it is RETRACT, and \
             some firmware switches the motors on again only after a restart; it is done when the body says \"confirm\": \
             \"motors off\"",
        ),
        (
            "reboot",
            "",
            422,
            "this is dangerous: the camera is not held until the gimbal has started; it is done when the body says \
             \"confirm\": \"reboot\"",
        ),
        ("point", r#"{"pitch_deg": -500}"#, 422, "pitch_deg: found -500; expected a number from -180 to 180"),
        ("stop", "{", 400, "the body is no JSON object: EOF while parsing an object at line 1 column 1"),
        ("stop", "\u{0}", 400, "the body is no JSON object: expected value at line 1 column 1"),
    ] {
        let answer = window.order(&format!("/api/v1/gimbals/camera/{path}"), body);
        assert_eq!((answer.status, answer.json()), (status, json!({"error": error})), "{path} {body}");
    }
    window.nothing_was_asked();
    assert_eq!(window.order("/api/v1/gimbals/camera/motors", r#"{"state":"off","confirm":"motors off"}"#).status, 200);
    let off = Asked::Operation(Operation::Motors(Motors::Off));
    assert_eq!(window.asked.try_recv(), Ok(("camera".to_owned(), off)));
}

/// What the gimbal does not have it does not answer; that is said once its parameters are known.
#[test]
fn a_parameter_that_was_not_read_is_not_there() {
    let window = with_token(Err(NotDone::Operation(OperationError::NoAnswer)));
    let answer = window.order("/api/v1/gimbals/camera/parameters/NIX", r#"{"value": 3}"#);
    let error = json!({"error": "no parameter \"NIX\" was read from the gimbal"});
    assert_eq!((answer.status, answer.json()), (404, error));
    for (gimbal, parameter) in [("camera", "RC_TYPE"), ("lamp", "NIX")] {
        let answer = window.order(&format!("/api/v1/gimbals/{gimbal}/parameters/{parameter}"), r#"{"value": 3}"#);
        assert_eq!(answer.status, 504, "{gimbal} {parameter}");
    }
}

/// "Body bounded; content type checked."
#[test]
fn a_body_is_json_of_a_bounded_length_that_comes_in_time() {
    let window = with_token(Ok(()));
    let right = format!("Authorization: Bearer {TOKEN}\r\n");
    for kind in ["", "Content-Type: text/plain\r\n", "Content-Type: application/x-www-form-urlencoded\r\n"] {
        assert_eq!(window.post(STOP, &format!("{right}{kind}"), "{}").status, 415, "{kind:?}");
    }
    for kind in ["application/json", "application/json; charset=utf-8", "Application/JSON"] {
        assert_eq!(window.post(STOP, &format!("{right}Content-Type: {kind}\r\n"), "{}").status, 200, "{kind}");
    }
    assert_eq!(window.post(STOP, &right, "").status, 200, "without a body there is no type");
    while window.asked.try_recv().is_ok() {}

    let json = format!("{right}Content-Type: application/json\r\n");
    let spaces = |count: usize| format!("{{{}}}", " ".repeat(count - 2));
    assert_eq!(window.post(STOP, &json, &spaces(4096)).status, 200);
    assert_eq!(window.asked.try_recv(), Ok(("camera".to_owned(), Asked::Stop)));
    assert_eq!(window.post(STOP, &json, &spaces(4097)).status, 413);
    let head = format!("POST {STOP} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n{json}");
    let chunk = format!("{:x}\r\n{}\r\n", 3000, " ".repeat(3000));
    assert_eq!(window.ask(&format!("{head}Transfer-Encoding: chunked\r\n\r\n{chunk}{chunk}0\r\n\r\n")).status, 413);
    // It is refused by what it says of itself, before it has come.
    assert_eq!(window.ask(&format!("{head}Content-Length: 1000000000000\r\n\r\n{{")).status, 413);
    assert_eq!(window.ask(&format!("{head}Content-Length: -1\r\n\r\n")).status, 400);
    assert_eq!(window.ask(&format!("{head}Content-Length: 10\r\n\r\n{{")).status, 408, "the rest never comes");
    window.nothing_was_asked();
}

/// "No control from a browser page of another origin."
#[test]
fn a_page_of_another_origin_controls_nothing() {
    let window = with_token(Ok(()));
    let right = format!("Authorization: Bearer {TOKEN}\r\n");
    for origin in
        ["http://evil.example", "null", "https://localhost", &format!("http://{}.evil.example", window.address)]
    {
        let answer = window.post(STOP, &format!("{right}Origin: {origin}\r\n"), "");
        assert_eq!((answer.status, answer.header("access-control-allow-origin")), (403, None), "{origin}");
    }
    let rebound = format!("POST {STOP} HTTP/1.1\r\nHost: evil.example\r\nConnection: close\r\n{right}\r\n");
    assert_eq!(window.ask(&rebound).status, 403);
    window.nothing_was_asked();
    assert_eq!(window.post(STOP, &format!("{right}Origin: http://{}\r\n", window.address), "").status, 200);
}

/// "404 unknown gimbal with the known names, 409 not in control (who has it), … 501 not supported by the family, 503/504
/// gimbal not there/no answer."
#[test]
fn what_is_not_done_has_its_status_and_its_reason() {
    let gcs = Some(MavId::new(255, 190));
    let refused = |refusal, holder| NotDone::Refused { refusal, holder };
    let later = |reason| Refusal { result: CommandResult::TemporarilyRejected, reason };
    let failed = |reason| Refusal { result: CommandResult::Failed, reason };
    for (not_done, status, expected) in [
        (
            refused(Refusal::denied("not_in_control"), gcs),
            409,
            json!({"error": "255/190 is in control", "reason": "not_in_control", "holder": "255/190"}),
        ),
        (
            refused(Refusal::denied("holder_must_release"), gcs),
            409,
            json!({
                "error": "255/190 is in control, and must release first (takeover = \"ask\")",
                "reason": "holder_must_release", "holder": "255/190",
            }),
        ),
        (
            refused(Refusal::denied("only_for_the_holder"), None),
            409,
            json!({"error": "only who has control may ask for that; take control first", "reason": "only_for_the_holder"}),
        ),
        (
            refused(Refusal::denied("nobody_in_control"), None),
            409,
            json!({
                "error": "nobody is in control, and unclaimed = \"closed\" lets nobody steer before; take control first",
                "reason": "nobody_in_control",
            }),
        ),
        (
            refused(later("no_gimbal_yet"), None),
            503,
            json!({"error": "no gimbal was heard yet", "reason": "no_gimbal_yet"}),
        ),
        (
            refused(later("gimbal_starting"), None),
            503,
            json!({
                "error": "the gimbal is starting; wait until it is ready, some 15 s, and ask again",
                "reason": "gimbal_starting",
            }),
        ),
        (refused(failed("gimbal_lost"), None), 503, json!({"error": "gimbal lost", "reason": "gimbal_lost"})),
        (
            refused(Refusal::denied("cannot_retract"), None),
            501,
            json!({"error": "cannot retract", "reason": "cannot_retract"}),
        ),
        (
            refused(Refusal::denied("no_such_place"), None),
            422,
            json!({"error": "no such place", "reason": "no_such_place"}),
        ),
        (
            NotDone::Operation(OperationError::Unsupported),
            501,
            json!({"error": "this gimbal has no such function", "reason": "unsupported"}),
        ),
        (
            NotDone::Operation(OperationError::NotConfigured("set v1_radio_control")),
            501,
            json!({"error": "set v1_radio_control", "reason": "not_configured"}),
        ),
        (
            NotDone::Operation(OperationError::NotThere),
            503,
            json!({"error": "the gimbal is not there", "reason": "not_there"}),
        ),
        (
            NotDone::Operation(OperationError::StillTurning),
            503,
            json!({
                "error": "the gimbal may still be turning, and is being stopped; ask again when it stands",
                "reason": "still_turning",
            }),
        ),
        (
            NotDone::Operation(OperationError::NoAnswer),
            504,
            json!({"error": "the gimbal did not answer", "reason": "no_answer"}),
        ),
        (
            NotDone::Operation(OperationError::NoParameters),
            504,
            json!({
                "error": "the gimbal tells no parameters: it has none, as many that speak v1, or does not hear that it is asked \
                          for them; check the line towards it",
                "reason": "no_parameters",
            }),
        ),
        (
            NotDone::Operation(OperationError::NoEffect("RC_TYPE is SBUS".to_owned())),
            502,
            json!({"error": "the gimbal answered, but did not do it: RC_TYPE is SBUS", "reason": "no_effect"}),
        ),
        (NotDone::TooMuch, 503, json!({"error": "too much is being done already; ask again"})),
        (NotDone::Starting, 503, json!({"error": "the system id of the vehicle is not settled yet"})),
        (NotDone::Ending, 503, json!({"error": "gimbald is ending"})),
        (NotDone::UnknownGimbal, 404, json!({"error": "no gimbal is called \"camera\"; there are: camera, lamp"})),
    ] {
        let answer = with_token(Err(not_done)).order(STOP, "");
        assert_eq!((answer.status, answer.json()), (status, expected));
    }
}

/// "Dangerous ones need an explicit word in the body": whether a retract cuts the motors the core alone knows, and what is
/// to be said is told as for what is always dangerous.
#[test]
fn a_retract_that_cuts_the_motors_is_told_its_word() {
    let unconfirmed = NotDone::Refused { refusal: Refusal::denied(UNCONFIRMED), holder: None };
    let answer = with_token(Err(unconfirmed)).order("/api/v1/gimbals/camera/retract", "");
    let error = "this is dangerous: with retract_allowed a Gremsy's motors are switched off; the camera falls to where its \
                 weight takes it, and some firmware switches the motors on again only after a restart; it is done when \
                 the body says \"confirm\": \"motors off\"";
    assert_eq!((answer.status, answer.json()), (422, json!({"error": error, "reason": "unconfirmed"})));

    let window = with_token(Ok(()));
    for (body, may_cut_motors) in [
        ("", false),
        (r#"{"confirm": "retract"}"#, false),
        (r#"{"confirm": true}"#, false),
        (r#"{"confirm": "motors off"}"#, true),
    ] {
        assert_eq!(window.order("/api/v1/gimbals/camera/retract", body).status, 200, "{body}");
        let asked = Asked::Retract { may_cut_motors };
        assert_eq!(window.asked.try_recv(), Ok(("camera".to_owned(), asked)), "{body}");
    }
}

/// Names with spaces, slashes and percent signs are names that no gimbal has.
#[test]
fn whatever_stands_for_a_name_is_only_a_name() {
    let window = with_token(Err(NotDone::UnknownGimbal));
    for (written, name) in [
        ("a%20b", "a b"),
        ("a%2Fb", "a/b"),
        ("..%2f..%2fetc", "../../etc"),
        ("%25", "%"),
        ("%00", "\u{0}"),
        ("%E2%80%AE", "\u{202e}"),
        ("camera%20", "camera "),
    ] {
        let error = json!({"error": format!("no gimbal is called {name:?}; there are: camera, lamp")});
        let read = window.get(&format!("/api/v1/gimbals/{written}"));
        assert_eq!((read.status, read.json()), (404, error.clone()), "{written}");
        let ordered = window.order(&format!("/api/v1/gimbals/{written}/stop"), "");
        assert_eq!((ordered.status, ordered.json()), (404, error), "{written}");
        assert_eq!(window.asked.try_recv(), Ok((name.to_owned(), Asked::Stop)));
    }
    for path in ["/api/v1/gimbals/%FF", "/api/v1/gimbals/%FF/attitude", "/api/v1/gimbals/camera/parameters/%FF"] {
        assert_eq!(window.get(path).status, 400, "{path}");
    }
    assert_eq!(window.order("/api/v1/gimbals/%FF/stop", "").status, 400);
    for path in ["/api/v1/gimbals/", "/api/v1/gimbals/camera/nothing", "/api/v1/gimbals/a/b/c"] {
        assert_eq!(window.order(path, "").status, 404, "{path}");
    }
    window.nothing_was_asked();
    assert_eq!(window.order("/api/v1/gimbals//stop", "").status, 404);
}

/// "`GET /api/v1/gimbals` (names), `GET /api/v1/gimbals/{name}` … and sub-resources of it", without a token.
#[test]
fn reading_needs_no_token() {
    let mut snapshot = canned::snapshot();
    snapshot.gimbals[0].details.parameters = [("PWR_PAN".to_owned(), 60.0)].into();
    snapshot.gimbals[0].details.faults = vec!["earth yaw is wrong".to_owned()];
    let window = Window::of(snapshot.clone());
    let camera = serde_json::to_value(&snapshot.gimbals[0]).expect("plain data");
    for (path, expected) in [
        ("", json!({"gimbals": ["camera", "lamp"]})),
        ("/camera", camera.clone()),
        ("/camera/attitude", camera["attitude"].clone()),
        ("/camera/setpoint", camera["setpoint"].clone()),
        ("/lamp/setpoint", Value::Null),
        ("/camera/details", camera["details"].clone()),
        ("/camera/faults", json!(["earth yaw is wrong"])),
        ("/camera/parameters", json!({"PWR_PAN": 60.0})),
        ("/camera/parameters/PWR_PAN", json!({"name": "PWR_PAN", "value": 60.0})),
        (
            "/camera/control",
            json!({
                "primary": "255/190", "secondary": null, "primary_age_ms": camera["primary_age_ms"],
                "secondary_age_ms": null, "lender": null, "takeover": camera["takeover"],
            }),
        ),
    ] {
        let answer = window.get(&format!("/api/v1/gimbals{path}"));
        assert_eq!((answer.status, answer.json()), (200, expected), "{path}");
    }
    let answer = window.get("/api/v1/gimbals/camera/parameters/pwr_pan");
    let error = json!({"error": "no parameter \"pwr_pan\" was read from the gimbal"});
    assert_eq!((answer.status, answer.json()), (404, error));
    let none = Window::of(Snapshot::default()).get("/api/v1/gimbals/camera");
    assert_eq!(none.json(), json!({"error": "no gimbal is called \"camera\"; there is none yet"}));
}

/// "Many requests at once": each gets its answer, and the core is asked as often as somebody asks.
#[test]
fn many_at_once_are_all_answered() {
    let window = with_token(Ok(()));
    let address = window.address;
    let order = move || {
        let mut stream = TcpStream::connect(address).expect("the window listens");
        let head = format!("POST {STOP} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n");
        let request = format!("{head}Authorization: Bearer {TOKEN}\r\n\r\n");
        stream.write_all(request.as_bytes()).expect("the window takes the request");
        Answer::read(stream).status
    };
    std::thread::scope(|scope| {
        let askers: Vec<_> = (0..100).map(|_| scope.spawn(order)).collect();
        let statuses: Vec<u16> = askers.into_iter().map(|asker| asker.join().expect("no panic")).collect();
        assert_eq!(statuses, [200; 100]);
    });
    assert_eq!(window.asked.try_iter().count(), 100);
}

/// "No unbounded waiting": a core that hangs is told of in time.
#[test]
fn a_core_that_hangs_does_not_hang_who_controls() {
    let token = Some(TOKEN.parse().expect("a token"));
    let window = Window::controlled(None, token, Ok(()), Limits::default());
    let start = now();
    let answer = window.order(STOP, "");
    assert_eq!((answer.status, answer.json()), (504, json!({"error": "the core did not answer in time"})));
    assert!(start.elapsed() < Duration::from_secs(10));
}

/// "Token guessing": the journal hears of it, now and then, and never of the token.
#[test]
fn guesses_are_told_but_no_token_is() {
    let journal = Journal::default();
    let writer = journal.clone();
    let subscriber = tracing_subscriber::fmt()
        .with_max_level(tracing::Level::TRACE)
        .with_ansi(false)
        .with_writer(move || writer.clone())
        .finish();
    let controls = {
        let (requests, _received) = mpsc::channel(1);
        crate::http::control::Controls::new(Some(TOKEN.parse().expect("a token")), requests, PATIENCE)
    };
    let mut headers = axum::http::HeaderMap::new();
    tracing::subscriber::with_default(subscriber, || {
        for guess in 0..100 {
            let given = format!("Bearer guess-number-{guess:03}").parse().expect("a header");
            headers.insert("authorization", given);
            let refused = controls.check_token(&headers).expect_err("a wrong token");
            assert_eq!(refused.status, 403);
        }
    });
    let text = journal.text();
    assert_eq!(text.lines().filter(|line| line.contains("with a wrong token")).count(), 7, "{text}");
    assert!(!text.contains("guess-number") && !text.contains(TOKEN), "{text}");
}
