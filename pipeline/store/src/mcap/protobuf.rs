//! Our own protobuf messages: encoding, and descriptors from the field lists of `sastrugi-schemas`.

use super::McapError;
use foxglove::Encode;
use foxglove::messages::{Log, Timestamp};
use prost::Message;
use prost::encoding as wire;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::source_code_info::Location;
use prost_types::{DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet, SourceCodeInfo};
use sastrugi_schemas::topics::{FieldKind, Topic};

/// Number of the field `timestamp`; the listed fields follow.
const TIMESTAMP: u32 = 1;
const TIMESTAMP_FILE: &str = "google/protobuf/timestamp.proto";

/// Field value.
pub(super) enum Value {
    Double(f64),
    Float(f64),
    Doubles(Vec<f64>),
    Floats(Vec<f64>),
    Text(String),
    Texts(Vec<String>),
}

impl Value {
    #[cfg(test)]
    pub(super) fn kind(&self) -> FieldKind {
        match self {
            Self::Double(_) => FieldKind::Double,
            Self::Float(_) => FieldKind::Float,
            Self::Doubles(_) => FieldKind::Doubles,
            Self::Floats(_) => FieldKind::Floats,
            Self::Text(_) => FieldKind::Text,
            Self::Texts(_) => FieldKind::Texts,
        }
    }

    fn encode(&self, number: u32, out: &mut Vec<u8>) {
        match self {
            Self::Double(v) => wire::double::encode(number, v, out),
            Self::Float(v) => wire::float::encode(number, &(*v as f32), out),
            Self::Doubles(v) => wire::double::encode_packed(number, v, out),
            Self::Floats(v) => {
                let v: Vec<f32> = v.iter().map(|&v| v as f32).collect();
                wire::float::encode_packed(number, &v, out);
            }
            Self::Text(v) => wire::string::encode(number, v, out),
            Self::Texts(v) => wire::string::encode_repeated(number, v, out),
        }
    }
}

/// Encodes a message from its values, in the order of the topic's fields. Zeros are written explicitly, because messages of equal
/// length compress better.
pub(super) fn encode(timestamp: &Timestamp, values: &[Value]) -> Vec<u8> {
    let mut out = Vec::with_capacity(256);
    wire::message::encode(TIMESTAMP, timestamp, &mut out);
    for (number, value) in (TIMESTAMP + 1..).zip(values) {
        value.encode(number, &mut out);
    }
    out
}

/// Descriptor set of a topic's message, with units and descriptions as comments.
pub(super) fn descriptor_set(topic: &Topic) -> Result<Vec<u8>, McapError> {
    let (package, name) = topic.schema.split_once('.').unwrap_or(("", topic.schema));
    let timestamp = FieldDescriptorProto {
        type_name: Some(".google.protobuf.Timestamp".to_owned()),
        ..descriptor("timestamp", TIMESTAMP, Type::Message, Label::Optional)
    };
    let own = topic.fields.iter().zip(TIMESTAMP + 1..).map(|(field, number)| {
        let (kind, label) = wire_type(field.kind);
        descriptor(field.name, number, kind, label)
    });
    let comments = topic.fields.iter().map(|f| match f.unit {
        "" => f.description.to_owned(),
        unit => format!("{} [{unit}]", f.description),
    });
    let comments = std::iter::once("time of the sample".to_owned()).chain(comments);
    let file = FileDescriptorProto {
        name: Some(format!("{package}/{name}.proto")),
        package: Some(package.to_owned()),
        dependency: vec![TIMESTAMP_FILE.to_owned()],
        message_type: vec![DescriptorProto {
            name: Some(name.to_owned()),
            field: std::iter::once(timestamp).chain(own).collect(),
            ..DescriptorProto::default()
        }],
        source_code_info: Some(SourceCodeInfo { location: locations(topic.description, comments) }),
        syntax: Some("proto3".to_owned()),
        ..FileDescriptorProto::default()
    };
    Ok(FileDescriptorSet { file: vec![timestamp_file()?, file] }.encode_to_vec())
}

fn wire_type(kind: FieldKind) -> (Type, Label) {
    match kind {
        FieldKind::Double => (Type::Double, Label::Optional),
        FieldKind::Float => (Type::Float, Label::Optional),
        FieldKind::Doubles => (Type::Double, Label::Repeated),
        FieldKind::Floats => (Type::Float, Label::Repeated),
        FieldKind::Text => (Type::String, Label::Optional),
        FieldKind::Texts => (Type::String, Label::Repeated),
    }
}

fn descriptor(name: &str, number: u32, kind: Type, label: Label) -> FieldDescriptorProto {
    FieldDescriptorProto {
        name: Some(name.to_owned()),
        number: Some(number as i32),
        label: Some(label as i32),
        r#type: Some(kind as i32),
        json_name: Some(name.to_owned()),
        ..FieldDescriptorProto::default()
    }
}

/// Comments: path `[4, 0]` is the file's first message, `[4, 0, 2, k]` its field k.
fn locations(message: &str, fields: impl Iterator<Item = String>) -> Vec<Location> {
    let location = |path: Vec<i32>, comment: String, line: i32| Location {
        path,
        span: vec![line, 0, 1],
        leading_comments: Some(format!(" {comment}\n")),
        ..Location::default()
    };
    let fields = fields.zip(0..).map(|(comment, k)| location(vec![4, 0, 2, k], comment, k + 1));
    std::iter::once(location(vec![4, 0], message.to_owned(), 0)).chain(fields).collect()
}

/// The descriptor of google.protobuf.Timestamp, taken from Foxglove's messages, so that a file contains only one.
fn timestamp_file() -> Result<FileDescriptorProto, McapError> {
    let schema = Log::get_schema().map(|s| s.data.into_owned()).unwrap_or_default();
    let set = FileDescriptorSet::decode(schema.as_slice()).unwrap_or_default();
    let file = set.file.into_iter().find(|f| f.name.as_deref() == Some(TIMESTAMP_FILE));
    file.ok_or_else(|| McapError::unfit("the descriptor of google.protobuf.Timestamp is missing"))
}
