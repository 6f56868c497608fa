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
    let file = FileDescriptorProto {
        name: Some(format!("{}.proto", T::NAME.replace('.', "/"))),
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
