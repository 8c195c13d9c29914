//! A report as JSON, or as a page of tables: the extension of the file decides.

use std::fmt::Write;

use serde_json::{Map, Value as Json};

use super::data::Report;
use super::escape::Text;
use super::page::{POLICY, STYLE, page};

/// How a report is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReportFormat {
    /// A page for people, complete in itself.
    Html,
    /// An object for programs.
    Json,
}

impl ReportFormat {
    /// The format that the name of a file asks for.
    ///
    /// # Errors
    /// Another extension; the message names both.
    pub fn of(path: &str) -> Result<Self, String> {
        if path == "-" {
            return Err("a report cannot be written to standard output; give it a file, such as report.html".to_owned());
        }
        let extension = path.rsplit_once('.').map(|(_, extension)| extension.to_ascii_lowercase());
        match extension.as_deref() {
            Some("html" | "htm") => Ok(Self::Html),
            Some("json") => Ok(Self::Json),
            _ => Err(format!("`{path}` is no name for a report (expected the extension .html or .json)")),
        }
    }
}

impl Report {
    /// The report on a clip; pictures are on the page alone.
    pub fn written(&self, format: ReportFormat) -> String {
        match format {
            ReportFormat::Html => page(self),
            ReportFormat::Json => {
                let mut object = Map::new();
                object.insert("version".to_owned(), 1.into());
                if let Ok(Json::Object(parts)) = serde_json::to_value(self) {
                    object.extend(parts);
                }
                format!("{:#}\n", Json::Object(object))
            }
        }
    }
}

/// A report on a photo or a mesh, called `title`.
pub fn document(title: &str, report: &Json, format: ReportFormat) -> String {
    match format {
        ReportFormat::Json => format!("{report:#}\n"),
        ReportFormat::Html => tables(title, report),
    }
}

/// The page: plain values first, then a section for each list and object.
fn tables(title: &str, report: &Json) -> String {
    let mut out = String::new();
    // Writing to a string does not fail, here and below.
    let _ = write!(
        out,
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"{}\"/>\n<link rel=\"icon\" href=\"data:,\"/>\n\
         <title>{name} – report</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<header>\n\
         <p class=\"kind\">Report</p>\n<h1>{name}</h1>\n</header>\n<main>\n",
        Text(POLICY),
        name = Text(title)
    );
    let empty = Map::new();
    let object = report.as_object().unwrap_or(&empty);
    section(&mut out, "Figures", object.iter().filter(|(_, value)| is_plain(value)));
    for (name, value) in object.iter().filter(|(_, value)| !is_plain(value)) {
        match value {
            Json::Object(parts) => section(&mut out, &words(name), parts.iter()),
            Json::Array(items) => rows(&mut out, &words(name), items),
            _ => {}
        }
    }
    let version = env!("CARGO_PKG_VERSION");
    let _ = write!(out, "</main>\n<footer><p>Made by plumbline {version}.</p></footer>\n</body>\n</html>\n");
    out
}

/// Names and values.
fn section<'a>(out: &mut String, title: &str, parts: impl Iterator<Item = (&'a String, &'a Json)>) {
    let _ = write!(out, "<section><h2>{}</h2>\n<table>", Text(title));
    for (name, value) in parts {
        let _ = write!(out, "<tr><th>{}</th><td>{}</td></tr>", Text(words(name)), Text(plain(value)));
    }
    out.push_str("</table></section>\n");
}

/// A list of objects as a table with a column per key, in the order of the first.
fn rows(out: &mut String, title: &str, items: &[Json]) {
    let columns: Vec<&String> = items.first().and_then(Json::as_object).into_iter().flat_map(Map::keys).collect();
    let _ = write!(out, "<section><h2>{}</h2>\n<table><tr>", Text(title));
    for column in &columns {
        let _ = write!(out, "<th>{}</th>", Text(words(column)));
    }
    out.push_str("</tr>");
    for item in items {
        out.push_str("<tr>");
        for column in &columns {
            let _ = write!(out, "<td>{}</td>", Text(plain(&item[column.as_str()])));
        }
        out.push_str("</tr>");
    }
    out.push_str("</table></section>\n");
}

/// The value fits in a cell: it is no object, and no list of objects.
fn is_plain(value: &Json) -> bool {
    match value {
        Json::Object(_) => false,
        Json::Array(items) => items.iter().all(|item| !item.is_object()),
        _ => true,
    }
}

/// A value as text; numbers have six digits at most.
fn plain(value: &Json) -> String {
    match value {
        Json::Null => "–".to_owned(),
        Json::Bool(yes) => if *yes { "yes" } else { "no" }.to_owned(),
        Json::String(text) => text.clone(),
        Json::Number(n) if n.is_f64() => {
            let rounded = n.as_f64().and_then(|x| format!("{x:.5e}").parse::<f64>().ok());
            rounded.map_or_else(|| n.to_string(), |x| x.to_string())
        }
        Json::Number(n) => n.to_string(),
        Json::Array(items) => items.iter().map(plain).collect::<Vec<_>>().join(", "),
        Json::Object(parts) => parts
            .iter()
            .map(|(name, value)| format!("{}: {}", words(name), plain(value)))
            .collect::<Vec<_>>()
            .join(", "),
    }
}

/// A key as words.
fn words(key: &str) -> String {
    key.replace('_', " ")
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn the_extension_chooses_the_format_and_another_is_refused_with_both_names() {
        assert_eq!(ReportFormat::of("a/b.HTML"), Ok(ReportFormat::Html));
        assert_eq!(ReportFormat::of("b.json"), Ok(ReportFormat::Json));
        for name in ["report", "report.txt", "html", ""] {
            assert!(ReportFormat::of(name).is_err_and(|e| e.contains(".html or .json")), "{name}");
        }
    }

    #[test]
    fn a_page_of_tables_holds_every_value_and_escapes_text() {
        let report = json!({
            "version": 1,
            "name": "<a>",
            "input": {"size": [4, 3], "gray": true},
            "lines": [{"name": "one", "max_px": 0.123_456_789}, {"name": "two", "max_px": null}],
            "nested": [{"a": {"b": 1}}],
        });
        let page = document("<x>.jpg", &report, ReportFormat::Html);
        for part in ["&lt;x&gt;.jpg", "&lt;a&gt;", "4, 3", "yes", "0.123457", "two", "max px", "b: 1"] {
            assert!(page.contains(part), "{part}: {page}");
        }
        assert!(!page.contains("<a>") && !page.contains("://") && !page.contains("<script"));
        assert_eq!(page.matches("<tr>").count(), page.matches("</tr>").count());
        let text = document("x", &report, ReportFormat::Json);
        assert_eq!(serde_json::from_str::<Json>(&text).expect("JSON"), report);
    }

    #[test]
    fn a_report_on_a_clip_is_json_too() {
        let report = Report { readout_s: Some(0.02), shots: std::iter::once(0..5).collect(), ..Report::default() };
        let json: Json = serde_json::from_str(&report.written(ReportFormat::Json)).expect("JSON");
        assert_eq!(
            (&json["version"], &json["readout_s"], &json["shots"][0]["end"]),
            (&1.into(), &0.02.into(), &5.into())
        );
        assert!(json["moments"].is_null(), "pictures are on the page alone");
        assert!(report.written(ReportFormat::Html).starts_with("<!DOCTYPE html>"));
    }
}
