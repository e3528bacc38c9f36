//! Flags that choose a value of the protocol by its name.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

/// Parses one of these names. Each has its value, and what the help says of it, if that says more than
/// the name.
pub(crate) fn choice<T: Copy + Send + Sync + 'static>(
    choices: &'static [(&'static str, T, &'static str)],
) -> impl TypedValueParser<Value = T> {
    let names = choices.iter().map(|(name, _, help)| {
        let name = PossibleValue::new(*name);
        match help.is_empty() {
            true => name,
            false => name.help(*help),
        }
    });
    PossibleValuesParser::new(names).map(|name| {
        let mut chosen = choices.iter().filter(|(known, ..)| *known == name);
        chosen.next().expect("only these names are parsed").1
    })
}
