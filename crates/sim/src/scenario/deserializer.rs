//! From the tree of a TOML text to the types that hold its keys.
//!
//! serde tells a deserializer the keys and choices that a type knows, so an error here is known by its parts: what was
//! not known, what is, and where it stands.
//!
//! A table whose keys depend on a choice is a struct whose field `kind` or `shape` is an enum: the keys that the struct
//! does not have are those of the choice. TOML writes both in one flat table.

use std::fmt::{self, Display};
use std::ops::Range;

use serde::de::value::{MapAccessDeserializer, MapDeserializer, SeqDeserializer};
use serde::de::{self, Error as _, IntoDeserializer, Unexpected, Visitor};
use serde::{Deserializer, forward_to_deserialize_any};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The fields that hold a choice.
pub(super) const CHOICES: [&str; 2] = ["kind", "shape"];

/// What is wrong with a key or its value.
#[derive(Debug)]
pub(super) struct KeyError {
    /// In one sentence.
    pub(super) message: String,
    /// The name that is not known.
    pub(super) unknown: Option<Unknown>,
    /// Where it stands in the text.
    pub(super) span: Option<Range<usize>>,
    /// Whether the type of the value asks for a whole number, which the value is not.
    pub(super) asks_for_whole: bool,
    /// Whether a key is missing.
    pub(super) is_missing: bool,
}

/// A name where another was expected.
#[derive(Debug)]
pub(super) enum Unknown {
    /// A key, and the keys that are known there.
    Key(String, Vec<&'static str>),
    /// A choice, and the choices.
    Choice(String, Vec<&'static str>),
}

impl KeyError {
    fn at(mut self, span: &Range<usize>) -> Self {
        self.span.get_or_insert_with(|| span.clone());
        self
    }

    /// Adds keys that are known beside those of a choice.
    fn beside(mut self, keys: &[&'static str]) -> Self {
        if let Some(Unknown::Key(_, known)) = &mut self.unknown {
            known.extend(keys);
        }
        self
    }
}

impl de::Error for KeyError {
    fn custom<T: Display>(message: T) -> Self {
        Self { message: message.to_string(), unknown: None, span: None, asks_for_whole: false, is_missing: false }
    }

    fn missing_field(field: &'static str) -> Self {
        Self { is_missing: true, ..Self::custom(format_args!("missing key `{field}`")) }
    }

    fn unknown_field(field: &str, expected: &'static [&'static str]) -> Self {
        let unknown = Some(Unknown::Key(field.to_owned(), expected.to_vec()));
        Self { unknown, ..Self::custom("unknown key") }
    }

    fn unknown_variant(variant: &str, expected: &'static [&'static str]) -> Self {
        let unknown = Some(Unknown::Choice(variant.to_owned(), expected.to_vec()));
        Self { unknown, ..Self::custom("unknown choice") }
    }
}

impl std::error::Error for KeyError {}

impl Display for KeyError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

/// A value of the tree, or a key or the name of a choice as one.
pub(super) struct Value<'de> {
    inner: DeValue<'de>,
    span: Range<usize>,
    /// Whether it is a choice: a table of the choice's name alone, which holds the table of its keys.
    is_choice: bool,
}

impl<'de> Value<'de> {
    fn new(inner: DeValue<'de>, span: Range<usize>) -> Self {
        Self { inner, span, is_choice: false }
    }

    fn unexpected(&self) -> Unexpected<'_> {
        match &self.inner {
            DeValue::String(text) => Unexpected::Str(text),
            DeValue::Integer(number) => i64::from_str_radix(number.as_str(), number.radix())
                .map_or(Unexpected::Other("number"), Unexpected::Signed),
            DeValue::Float(number) => number.as_str().parse().map_or(Unexpected::Other("number"), Unexpected::Float),
            DeValue::Boolean(flag) => Unexpected::Bool(*flag),
            DeValue::Datetime(_) => Unexpected::Other("date"),
            DeValue::Array(_) => Unexpected::Seq,
            DeValue::Table(_) => Unexpected::Map,
        }
    }

    fn wrong_type(&self, expected: &str) -> KeyError {
        KeyError::invalid_type(self.unexpected(), &expected).at(&self.span)
    }

    fn whole_number(&self, most: u64) -> Result<u64, KeyError> {
        const FROM_0: &str = "a whole number from 0";
        let DeValue::Integer(written) = &self.inner else {
            return Err(KeyError { asks_for_whole: true, ..self.wrong_type(FROM_0) });
        };
        let number = u64::from_str_radix(written.as_str(), written.radix()).ok().filter(|&number| number <= most);
        number.ok_or_else(|| KeyError::invalid_value(self.unexpected(), &FROM_0).at(&self.span))
    }
}

impl<'de> From<Spanned<DeValue<'de>>> for Value<'de> {
    fn from(value: Spanned<DeValue<'de>>) -> Self {
        let span = value.span();
        Self::new(value.into_inner(), span)
    }
}

/// The keys and values of a table.
fn entries(table: DeTable<'_>) -> impl Iterator<Item = (Value<'_>, Value<'_>)> {
    table.into_iter().map(|(key, value)| {
        let span = key.span();
        (Value::new(DeValue::String(key.into_inner()), span), Value::from(value))
    })
}

impl<'de> Deserializer<'de> for Value<'de> {
    type Error = KeyError;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, KeyError> {
        match self.inner {
            DeValue::String(text) => visitor.visit_str(&text),
            DeValue::Integer(number) => match i64::from_str_radix(number.as_str(), number.radix()) {
                Ok(number) => visitor.visit_i64(number),
                Err(_) => Err(KeyError::custom("integer number overflowed")),
            },
            DeValue::Float(number) => match number.as_str().parse::<f64>() {
                Ok(parsed) if parsed.is_finite() || !number.as_str().ends_with(|c: char| c.is_ascii_digit()) => {
                    visitor.visit_f64(parsed)
                }
                _ => Err(KeyError::custom("floating-point number overflowed")),
            },
            DeValue::Boolean(flag) => visitor.visit_bool(flag),
            DeValue::Datetime(_) => Err(KeyError::invalid_type(Unexpected::Other("date"), &visitor)),
            DeValue::Array(list) => {
                let mut list = SeqDeserializer::new(list.into_iter().map(Value::from));
                visitor.visit_seq(&mut list).and_then(|value| list.end().map(|()| value))
            }
            DeValue::Table(table) => visitor.visit_map(MapDeserializer::new(entries(table))),
        }
        .map_err(|error| error.at(&self.span))
    }

    fn deserialize_f64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, KeyError> {
        match self.inner {
            DeValue::Integer(_) | DeValue::Float(_) => self.deserialize_any(visitor),
            _ => Err(self.wrong_type("a number")),
        }
    }

    fn deserialize_u32<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, KeyError> {
        visitor.visit_u64(self.whole_number(u32::MAX.into())?)
    }

    fn deserialize_u64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, KeyError> {
        visitor.visit_u64(self.whole_number(u64::MAX)?)
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, KeyError> {
        visitor.visit_some(self)
    }

    fn deserialize_unit<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, KeyError> {
        match self.inner.as_table().and_then(|table| table.keys().next()) {
            Some(key) => Err(KeyError::unknown_field(key.get_ref(), &[]).at(&key.span())),
            None => visitor.visit_unit(),
        }
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, KeyError> {
        let span = self.span.clone();
        let DeValue::Table(table) = self.inner else { return Err(self.wrong_type("a table")) };
        let is_chosen = |key: &&str| table.get(*key).is_some_and(|value| value.get_ref().is_str());
        let Some(choice) = CHOICES.into_iter().find(|key| fields.contains(key) && is_chosen(key)) else {
            return visitor.visit_map(MapDeserializer::new(entries(table))).map_err(|error| error.at(&span));
        };
        let (own, keys): (DeTable<'_>, _) = table.into_iter().partition(|(key, _)| fields.contains(&&**key.get_ref()));
        let mut keys = Some(Spanned::new(span.clone(), DeValue::Table(keys)));
        let own = entries(own).map(|(key, mut value)| {
            if let (DeValue::String(name), true) = (&value.inner, key.inner.as_str() == Some(choice)) {
                let name = Spanned::new(value.span.clone(), name.clone());
                value.inner = DeValue::Table(keys.take().map(|keys| (name, keys)).into_iter().collect());
                value.is_choice = true;
            }
            (key, value)
        });
        visitor.visit_map(MapDeserializer::new(own)).map_err(|error| error.beside(fields).at(&span))
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, KeyError> {
        let span = self.span;
        match self.inner {
            DeValue::Table(choice) if self.is_choice => {
                visitor.visit_enum(MapAccessDeserializer::new(MapDeserializer::new(entries(choice))))
            }
            DeValue::String(name) => visitor.visit_enum(name.into_deserializer()),
            _ => Err(KeyError::custom("expected a string")),
        }
        .map_err(|error| error.at(&span))
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u128 f32 char str string bytes byte_buf unit_struct newtype_struct seq tuple
        tuple_struct map identifier ignored_any
    }
}

impl<'de> IntoDeserializer<'de, KeyError> for Value<'de> {
    type Deserializer = Self;

    fn into_deserializer(self) -> Self {
        self
    }
}
