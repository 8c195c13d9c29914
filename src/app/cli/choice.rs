//! Options whose value is a choice: words and help texts are those of the schema, the value is what serde reads.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde_json::Value as Json;

use crate::pipeline::words_of;

/// A parser of the words of `T`, an enum of words.
pub(super) fn choice<T>() -> impl TypedValueParser<Value = T>
where
    T: JsonSchema + DeserializeOwned + Clone + Send + Sync + 'static,
{
    let value = |(word, help): (String, String)| PossibleValue::new(word).help(help);
    let words: Vec<PossibleValue> = words_of::<T>().into_iter().map(value).collect();
    let parsed =
        |word: String| serde_json::from_value(Json::String(word)).expect("serde reads the words of the schema");
    PossibleValuesParser::new(words).map(parsed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::kinds::{ModelChoice, PathMethod};

    #[test]
    fn every_word_of_the_schema_is_read_as_its_choice() {
        for (word, help) in words_of::<ModelChoice>() {
            assert!(!help.is_empty(), "{word}");
            let choice: ModelChoice = serde_json::from_value(Json::String(word.clone())).expect("a choice");
            assert_eq!(choice.to_string(), word);
        }
        assert_eq!(words_of::<PathMethod>().len(), 7);
    }
}
