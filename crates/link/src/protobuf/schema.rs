//! A record's protobuf `FileDescriptorSet`, which viewers read from the file.
//!
//! # Sources
//! `google/protobuf/descriptor.proto`; MCAP's registry of schema encodings:
//! <https://mcap.dev/spec/registry>.

use super::encode::{put_bytes, put_number};
use super::{Fields, Nested, Visit};

/// The serialised description of `T` and of the messages nested in it.
pub(crate) fn file_descriptor_set<T: Fields>() -> Vec<u8> {
    let mut describer = Describer { finished: Vec::new(), open: vec![Message::new(T::NAME)] };
    T::default().visit(&mut describer);
    describer.finished.append(&mut describer.open);

    let mut file = Vec::new();
    put_bytes(&mut file, 1, format!("{}.proto", T::NAME.replace('.', "/")).as_bytes());
    put_bytes(&mut file, 2, PACKAGE.as_bytes());
    for message in &describer.finished {
        put_bytes(&mut file, 4, &message.descriptor);
    }
    put_bytes(&mut file, 12, b"proto3");
    let mut set = Vec::new();
    put_bytes(&mut set, 1, &file);
    set
}

const PACKAGE: &str = "trepan";

/// `FieldDescriptorProto.Type`.
#[derive(Clone, Copy)]
enum Kind {
    Double = 1,
    Float = 2,
    Uint64 = 4,
    String = 9,
    Message = 11,
    Uint32 = 13,
}

/// A `DescriptorProto` under construction.
struct Message {
    name: &'static str,
    descriptor: Vec<u8>,
}

impl Message {
    fn new(name: &'static str) -> Self {
        let mut descriptor = Vec::new();
        put_bytes(&mut descriptor, 1, name.trim_start_matches("trepan.").as_bytes());
        Self { name, descriptor }
    }

    fn field(&mut self, number: u32, name: &str, kind: Kind, type_name: Option<&str>) {
        const LABEL_OPTIONAL: u64 = 1;
        let mut field = Vec::new();
        put_bytes(&mut field, 1, name.as_bytes());
        put_number(&mut field, 3, u64::from(number));
        put_number(&mut field, 4, LABEL_OPTIONAL);
        put_number(&mut field, 5, kind as u64);
        if let Some(type_name) = type_name {
            put_bytes(&mut field, 6, format!(".{type_name}").as_bytes());
        }
        put_bytes(&mut self.descriptor, 2, &field);
    }
}

/// Collects messages; the innermost open one is the last.
struct Describer {
    finished: Vec<Message>,
    open: Vec<Message>,
}

impl Describer {
    fn field(&mut self, number: u32, name: &str, kind: Kind, type_name: Option<&str>) {
        if let Some(message) = self.open.last_mut() {
            message.field(number, name, kind, type_name);
        }
    }
}

impl Visit for Describer {
    fn uint32(&mut self, number: u32, name: &'static str, _: &mut u32) {
        self.field(number, name, Kind::Uint32, None);
    }

    fn uint64(&mut self, number: u32, name: &'static str, _: &mut u64) {
        self.field(number, name, Kind::Uint64, None);
    }

    fn float(&mut self, number: u32, name: &'static str, _: &mut f32) {
        self.field(number, name, Kind::Float, None);
    }

    fn double(&mut self, number: u32, name: &'static str, _: &mut f64) {
        self.field(number, name, Kind::Double, None);
    }

    fn string(&mut self, number: u32, name: &'static str, _: &mut String) {
        self.field(number, name, Kind::String, None);
    }

    fn message(&mut self, number: u32, name: &'static str, kind: &'static str, fields: Nested<'_>) {
        self.field(number, name, Kind::Message, Some(kind));
        if self.finished.iter().any(|message| message.name == kind) {
            return;
        }
        self.open.push(Message::new(kind));
        fields(self);
        self.finished.extend(self.open.pop());
    }
}
