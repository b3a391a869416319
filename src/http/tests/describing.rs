//! What the window says of itself to programs.

use super::*;
use crate::actions::{ACTIONS, CONFIRM};

/// `GET /api/v1/openapi.json`: every action of the table is described, with each of its fields.
#[test]
fn the_window_describes_itself() {
    let described = Window::of(Snapshot::default()).get("/api/v1/openapi.json").json();
    assert_eq!(described["openapi"], "3.1.0");
    for action in ACTIONS {
        let operation = &described["paths"][format!("/api/v1/gimbals/{{name}}/{}", action.path)]["post"];
        assert_eq!(operation["operationId"], action.command);
        assert_eq!(operation["security"], json!([{"token": []}]));
        let schema = &operation["requestBody"]["content"]["application/json"]["schema"];
        for field in action.body_fields() {
            assert_eq!(schema["properties"][field.name]["description"], field.about, "{}", action.path);
        }
        assert_eq!(schema["properties"][CONFIRM]["const"].as_str(), action.word(), "{}", action.path);
    }
    let statuses = |path: &str, method: &str| -> Vec<&str> {
        let responses = described["paths"][path][method]["responses"].as_object().expect(path);
        responses.keys().map(String::as_str).collect()
    };
    for path in ["/api/v1/status", "/api/v1/gimbals", "/healthz", "/readyz"] {
        assert_eq!(statuses(path, "get"), ["200", "403", "503"], "{path}");
    }
    for path in ["", "/attitude", "/parameters/{parameter}"] {
        let path = format!("/api/v1/gimbals/{{name}}{path}");
        assert_eq!(statuses(&path, "get"), ["200", "400", "403", "404", "503"], "{path}");
    }
    let all = "200 400 401 403 404 408 409 413 415 422 501 502 503 504".split(' ').collect::<Vec<_>>();
    assert_eq!(statuses("/api/v1/gimbals/{name}/stop", "post"), all);
    for (action, body, is_needed) in
        [("stop", json!([]), false), ("retract", json!([]), false), ("reboot", json!([CONFIRM]), true)]
    {
        let request = &described["paths"][format!("/api/v1/gimbals/{{name}}/{action}")]["post"]["requestBody"];
        assert_eq!(request["required"], is_needed, "{action}");
        assert_eq!(request["content"]["application/json"]["schema"]["required"], body, "{action}");
    }
}
