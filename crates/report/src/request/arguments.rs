//! Parsers of arguments that have names as values.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

/// Returns a parser of names with their values.
#[must_use]
pub fn one_of<T: Clone + Send + Sync + 'static>(choices: Vec<(PossibleValue, T)>) -> impl TypedValueParser<Value = T> {
    let names = choices.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
    PossibleValuesParser::new(names).try_map(move |given| {
        let chosen = choices.iter().find(|(name, _)| name.get_name() == given);
        chosen.map(|(_, value)| value.clone()).ok_or("not one of the possible values")
    })
}
