//! Generates the shapes of all messages (see `src/cost.rs`) from their descriptors.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, FieldDescriptorProto, FileDescriptorSet};

/// The only message of another package.
const TIMESTAMP: &str = "google.protobuf.Timestamp";
const PACKAGE: &str = "chefshat.v1";

/// A message: its full name, its type in Rust (`None` for entries of maps), and its fields.
struct Message<'a> {
    rust: Option<String>,
    descriptor: &'a DescriptorProto,
}

/// The text of a module with a static for each message, and a list of all calls.
pub(crate) fn of(set: &FileDescriptorSet) -> String {
    let mut messages = BTreeMap::new();
    let files = || set.file.iter().filter(|file| file.package() == PACKAGE);
    for message in files().flat_map(|file| &file.message_type) {
        collect(PACKAGE, "crate::v1", message, &mut messages);
    }
    let mut text = format!(
        "/// A point in time.\npub static TIMESTAMP: Shape = Shape {{ name: {TIMESTAMP:?}, size: size_of::<crate::Timestamp>(), fields: &[] }};\n"
    );
    for (name, message) in &messages {
        let size = match &message.rust {
            Some(rust) => format!("size_of::<{rust}>()"),
            None => "2 * size_of::<String>()".to_owned(),
        };
        let fields: String = (message.descriptor.field.iter())
            .map(|it| field(it, &messages))
            .collect();
        let constant = constant(name);
        writeln!(
            text,
            "/// `{name}`.\npub static {constant}: Shape = Shape {{ name: {name:?}, size: {size}, fields: &[{fields}] }};"
        )
        .expect("memory");
    }
    text += "/// The calls of all services, by path.\npub static METHODS: &[Method] = &[\n";
    for service in files().flat_map(|file| &file.service) {
        for method in &service.method {
            let name = method.input_type().trim_start_matches('.');
            let rust = messages[name].rust.as_ref().expect("not an entry of a map");
            writeln!(
                text,
                "Method {{ path: \"/{PACKAGE}.{}/{}\", request: &{}, decode: |bytes| Ok(Box::new(<{rust} as prost::Message>::decode(bytes)?)) }},",
                service.name(),
                method.name(),
                constant(name)
            )
            .expect("memory");
        }
    }
    text + "];\n"
}

fn collect<'a>(
    scope: &str,
    module: &str,
    message: &'a DescriptorProto,
    messages: &mut BTreeMap<String, Message<'a>>,
) {
    let name = format!("{scope}.{}", message.name());
    let is_entry = message.options.as_ref().is_some_and(|it| it.map_entry());
    for nested in &message.nested_type {
        let module = format!("{module}::{}", snake(message.name()));
        collect(&name, &module, nested, messages);
    }
    let rust = (!is_entry).then(|| format!("{module}::{}", message.name()));
    messages.insert(
        name,
        Message {
            rust,
            descriptor: message,
        },
    );
}

fn field(field: &FieldDescriptorProto, messages: &BTreeMap<String, Message<'_>>) -> String {
    let number =
        |size: usize, width: usize| format!("Kind::Number {{ size: {size}, width: {width} }}");
    let kind = match field.r#type() {
        Type::String | Type::Bytes => "Kind::Text".to_owned(),
        Type::Message => {
            let name = field.type_name().trim_start_matches('.');
            let is_entry = messages.get(name).is_some_and(|it| it.rust.is_none());
            let kind = if is_entry { "Entry" } else { "Message" };
            format!("Kind::{kind}(&{})", constant(name))
        }
        Type::Double | Type::Fixed64 | Type::Sfixed64 => number(8, 8),
        Type::Float | Type::Fixed32 | Type::Sfixed32 => number(4, 4),
        Type::Int64 | Type::Uint64 | Type::Sint64 => number(8, 0),
        Type::Bool => number(1, 0),
        Type::Int32 | Type::Uint32 | Type::Sint32 | Type::Enum => number(4, 0),
        Type::Group => panic!("groups are not supported"),
    };
    let (number, list) = (field.number(), field.label() == Label::Repeated);
    format!("Field {{ number: {number}, list: {list}, kind: {kind} }}, ")
}

/// The name of the static of a message.
fn constant(name: &str) -> String {
    let name = name.trim_start_matches(PACKAGE).trim_start_matches('.');
    match name == TIMESTAMP {
        true => "TIMESTAMP".to_owned(),
        false => name
            .split('.')
            .map(snake)
            .collect::<Vec<_>>()
            .join("_")
            .to_uppercase(),
    }
}

fn snake(name: &str) -> String {
    let mut text = String::new();
    for (index, letter) in name.chars().enumerate() {
        if letter.is_uppercase() && index > 0 {
            text.push('_');
        }
        text.push(letter.to_ascii_lowercase());
    }
    text
}
