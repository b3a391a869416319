//! `/api/v1/openapi.json`: the window for programs that write programs (OpenAPI 3.1), from the same tables as its routes.

use serde_json::{Map, Value, json};

use super::gimbals::PARTS;
use super::routes::GIMBALS;
use crate::actions::{ACTIONS, Action, CONFIRM, Danger, Field, Kind};

pub fn description() -> Value {
    let mut paths = Map::new();
    let mut add = |path: String, method: &str, operation: Value| {
        let entry = paths.entry(path).or_insert_with(|| json!({}));
        entry[method] = operation;
    };
    for (path, about, right, not) in [
        ("/api/v1/status", "Everything that there is to see", AS_JSON, NO_CORE),
        (GIMBALS, "The names of the gimbals", AS_JSON, NO_CORE),
        ("/healthz", "Whether the process is alive", "the text ok", NO_CORE),
        ("/readyz", "Whether all that is configured is there", "it is", "it is not; reasons says what is missing"),
    ] {
        add(path.to_owned(), "get", reading(about, &[], &[("200", right), ("503", not)]));
    }
    add("/api/v1/openapi.json".to_owned(), "get", reading("This description", &[], &[("200", AS_JSON)]));
    let of_gimbal = |rest: &str| format!("{GIMBALS}/{{name}}{rest}");
    let name = parameter("name", "the gimbal", &json!({"type": "string"}));
    add(of_gimbal(""), "get", reading("All of one gimbal", &[&name], &OF_GIMBAL));
    for (part, about) in PARTS {
        add(of_gimbal(&format!("/{part}")), "get", reading(about, &[&name], &OF_GIMBAL));
    }
    let of_parameter = parameter("parameter", "its name", &json!({"type": "string"}));
    add(
        of_gimbal("/parameters/{parameter}"),
        "get",
        reading("One parameter, as far as it was read", &[&name, &of_parameter], &OF_GIMBAL),
    );
    for action in ACTIONS {
        let in_path = action.path_field().map(|field| parameter(field.name, field.about, &schema(field)));
        let parameters: Vec<&Value> = [Some(&name), in_path.as_ref()].into_iter().flatten().collect();
        add(of_gimbal(&format!("/{}", action.path)), "post", asking(action, &parameters));
    }
    json!({
        "openapi": "3.1.0",
        "info": {"title": "gimbald", "version": env!("CARGO_PKG_VERSION"), "license": {"name": "MIT OR Apache-2.0"}},
        "paths": paths,
        "components": {"securitySchemes": {"token": {"type": "http", "scheme": "bearer"}}},
    })
}

const AS_JSON: &str = "as JSON";
const NO_CORE: &str = "the core did not answer";

/// What may be answered to whoever names a gimbal.
const OF_GIMBAL: [(&str, &str); 4] = [
    ("200", AS_JSON),
    ("400", "the path is not UTF-8"),
    ("404", "the gimbal, or what is asked of it, is not there"),
    ("503", NO_CORE),
];

fn reading(about: &str, parameters: &[&Value], answers: &[(&str, &str)]) -> Value {
    json!({"summary": about, "parameters": parameters, "responses": responses(answers)})
}

/// Statuses with what they mean, and the one of a stranger, who is answered nothing else.
fn responses(answers: &[(&str, &str)]) -> Value {
    let stranger = ("403", "a Host that this window does not answer to");
    let described = |(status, about): &(&str, &str)| ((*status).to_owned(), json!({"description": about}));
    [stranger].iter().chain(answers).map(described).collect::<Map<_, _>>().into()
}

fn asking(action: &Action, parameters: &[&Value]) -> Value {
    let mut properties = Map::new();
    for field in action.body_fields() {
        properties.insert(field.name.to_owned(), schema(field));
    }
    if let Some(Danger { word, when, cost }) = action.danger {
        let when = when.unwrap_or("always");
        let about = format!("what is dangerous needs it, {when}: {cost}");
        properties.insert(CONFIRM.to_owned(), json!({"const": word, "description": about}));
    }
    let mut required: Vec<&str> = action.body_fields().filter(|field| field.required).map(|field| field.name).collect();
    required.extend(action.danger.filter(|danger| danger.when.is_none()).map(|_| CONFIRM));
    let body = json!({
        "type": "object",
        "additionalProperties": false,
        "properties": properties,
        "required": required,
    });
    json!({
        "summary": action.about,
        "operationId": action.command,
        "security": [{"token": []}],
        "parameters": parameters,
        "requestBody": {"required": !required.is_empty(), "content": {"application/json": {"schema": body}}},
        "responses": responses(&[
            ("200", "done"),
            ("400", "the body is no JSON object, or did not come whole"),
            ("401", "no token"),
            ("403", "a wrong token, none configured, another origin or Host"),
            ("404", "no such gimbal, or it has no such parameter"),
            ("408", "the body did not come in time"),
            ("409", "not in control; holder says who is"),
            ("413", "the body is larger than 4096 bytes"),
            ("415", "the body is not said to be JSON"),
            ("422", "something in the body is wrong"),
            ("501", "this gimbal has no such function, or its entry in the configuration does not say that it has"),
            ("502", "the gimbal did not do it"),
            ("503", "not for the moment"),
            ("504", "no answer"),
        ]),
    })
}

fn parameter(name: &str, about: &str, schema: &Value) -> Value {
    json!({"name": name, "in": "path", "required": true, "description": about, "schema": schema})
}

fn schema(field: &Field) -> Value {
    let mut schema = match field.kind {
        Kind::Number { min, max } => json!({"type": "number", "minimum": min, "maximum": max}),
        Kind::Word(words) => json!({"type": "string", "enum": words}),
        Kind::WholeOrWord { min, max, words } => json!({
            "oneOf": [{"type": "integer", "minimum": min, "maximum": max}, {"type": "string", "enum": words}],
        }),
        Kind::Flag => json!({"type": "boolean"}),
        Kind::Name { longest } => json!({"type": "string", "minLength": 1, "maxLength": longest}),
    };
    schema["description"] = field.about.into();
    schema
}
