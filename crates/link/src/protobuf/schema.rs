//! A record's protobuf `FileDescriptorSet`, which viewers read from the file.
//!
//! # Sources
//! MCAP's registry of schema encodings: <https://mcap.dev/spec/registry>.

use super::{Fields, Value, Visit};
use prost::Message;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet};

const PACKAGE: &str = "trepan";

/// The serialised description of `T` and of the messages nested in it.
pub(crate) fn file_descriptor_set<T: Fields>() -> Vec<u8> {
    let mut describer = Describer { finished: Vec::new(), open: message(T::NAME) };
    T::default().visit(&mut describer);
    let Describer { finished: mut message_type, open } = describer;
    message_type.push(open);
    set_of(T::NAME, message_type)
}

/// The serialised description of a message of `tick`, `time_ms` and a double for each name.
pub(crate) fn numbers_descriptor_set(message_name: &str, names: &[String]) -> Vec<u8> {
    let kinds = [("tick", Type::Uint64), ("time_ms", Type::Double)];
    let all = kinds.into_iter().chain(names.iter().map(|name| (name.as_str(), Type::Double)));
    let field = all.zip(1..).map(|((name, kind), number)| FieldDescriptorProto {
        name: Some(name.to_owned()),
        number: Some(number),
        label: Some(Label::Optional.into()),
        r#type: Some(kind.into()),
        ..Default::default()
    });
    let message = DescriptorProto { field: field.collect(), ..message(message_name) };
    set_of(message_name, vec![message])
}

fn set_of(name: &str, message_type: Vec<DescriptorProto>) -> Vec<u8> {
    let file = FileDescriptorProto {
        name: Some(format!("{}.proto", name.replace('.', "/"))),
        package: Some(PACKAGE.to_owned()),
        message_type,
        syntax: Some("proto3".to_owned()),
        ..Default::default()
    };
    FileDescriptorSet { file: vec![file] }.encode_to_vec()
}

fn message(name: &str) -> DescriptorProto {
    DescriptorProto { name: name.split('.').next_back().map(str::to_owned), ..Default::default() }
}

/// Collects messages: those that are complete, and the innermost of the others.
struct Describer {
    finished: Vec<DescriptorProto>,
    open: DescriptorProto,
}

impl Visit for Describer {
    fn field(&mut self, number: u32, name: &'static str, value: Value<'_>) {
        let (kind, type_name) = match &value {
            Value::Uint32(_) => (Type::Uint32, None),
            Value::Uint64(_) => (Type::Uint64, None),
            Value::Float(_) => (Type::Float, None),
            Value::Double(_) => (Type::Double, None),
            Value::String(_) => (Type::String, None),
            Value::Words(_) => (Type::Bytes, None),
            Value::Message(name, _) => (Type::Message, Some(format!(".{name}"))),
        };
        self.open.field.push(FieldDescriptorProto {
            name: Some(name.to_owned()),
            number: Some(number.cast_signed()),
            label: Some(Label::Optional.into()),
            r#type: Some(kind.into()),
            type_name,
            ..Default::default()
        });
        if let Value::Message(name, fields) = value {
            let nested = message(name);
            if !self.finished.iter().any(|message| message.name == nested.name) {
                let outer = std::mem::replace(&mut self.open, nested);
                fields(self);
                self.finished.push(std::mem::replace(&mut self.open, outer));
            }
        }
    }
}
