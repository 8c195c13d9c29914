//! `deny.toml` on the packages that this system builds, wherever there is no `cargo deny`: licenses, bans, sources. `make
//! test-long` runs `cargo deny` itself, on the packages of all systems.

use std::collections::BTreeSet;
use std::process::Command;

use serde_json::Value;
use toml_edit::{DocumentMut, Item};

/// True where `expression` (SPDX, or with `/` for OR as older manifests have it) can be met by licenses that are allowed.
fn is_met(expression: &str, allowed: &BTreeSet<&str>) -> bool {
    let text = expression.replace('/', " OR ").replace('(', " ( ").replace(')', " ) ").replace(" WITH ", "+WITH+");
    let mut words = text.split_whitespace().peekable();
    any(&mut words, allowed)
}

type Words<'a> = std::iter::Peekable<std::str::SplitWhitespace<'a>>;

fn any(words: &mut Words<'_>, allowed: &BTreeSet<&str>) -> bool {
    let mut met = all(words, allowed);
    while words.next_if_eq(&"OR").is_some() {
        met |= all(words, allowed);
    }
    met
}

fn all(words: &mut Words<'_>, allowed: &BTreeSet<&str>) -> bool {
    let mut met = one(words, allowed);
    while words.next_if_eq(&"AND").is_some() {
        met &= one(words, allowed);
    }
    met
}

fn one(words: &mut Words<'_>, allowed: &BTreeSet<&str>) -> bool {
    if words.next_if_eq(&"(").is_some() {
        let met = any(words, allowed);
        return words.next() == Some(")") && met;
    }
    words.next().is_some_and(|license| allowed.contains(license.replace("+WITH+", " WITH ").as_str()))
}

fn texts(item: &Item) -> Vec<&str> {
    item.as_array().into_iter().flatten().filter_map(toml_edit::Value::as_str).collect()
}

fn packages() -> Vec<Value> {
    let host = Command::new("rustc").args(["--print", "host-tuple"]).output().expect("rustc runs");
    let host = String::from_utf8(host.stdout).expect("UTF-8");
    let args = ["metadata", "--locked", "--offline", "--format-version", "1", "--filter-platform", host.trim()];
    let listed = Command::new(env!("CARGO")).args(args).output().expect("cargo runs");
    assert!(listed.status.success(), "{}", String::from_utf8_lossy(&listed.stderr));
    let mut found: Value = serde_json::from_slice(&listed.stdout).expect("JSON");
    serde_json::from_value(found["packages"].take()).expect("a list")
}

#[test]
fn packages_have_licenses_names_and_sources_that_are_allowed() {
    let text = std::fs::read_to_string("deny.toml").expect("the rules");
    let rules: DocumentMut = text.parse().expect("TOML");
    let allowed: BTreeSet<&str> = texts(&rules["licenses"]["allow"]).into_iter().collect();
    let exceptions = rules["licenses"]["exceptions"].as_array().into_iter().flatten();
    let exceptions: Vec<_> = exceptions.filter_map(toml_edit::Value::as_inline_table).collect();
    let banned = rules["bans"]["deny"].as_array().into_iter().flatten();
    let banned: Vec<_> = banned.filter_map(|b| b.as_inline_table()?.get("name")?.as_str()).collect();
    assert!(
        allowed.contains("MIT") && !exceptions.is_empty() && banned.contains(&"openblas-src"),
        "the rules are read"
    );
    let packages = packages();
    assert!(packages.len() > 200, "{} packages", packages.len());
    for package in packages {
        let name = package["name"].as_str().expect("a name");
        let exception = exceptions.iter().find(|e| e.get("crate").and_then(|c| c.as_str()) == Some(name));
        let more = exception.and_then(|e| e.get("allow")?.as_array()).into_iter().flatten();
        let more = more.filter_map(toml_edit::Value::as_str);
        let allowed: BTreeSet<&str> = allowed.iter().copied().chain(more).collect();
        let license = package["license"].as_str().unwrap_or("none");
        assert!(is_met(license, &allowed), "{name} is under {license}, which deny.toml does not allow");
        assert!(!banned.contains(&name), "{name} is banned by deny.toml");
        let source = package["source"].as_str();
        assert!(
            source.is_none_or(|s| s == "registry+https://github.com/rust-lang/crates.io-index"),
            "{name}: {source:?}"
        );
    }
}

#[test]
fn license_expressions_are_read_as_spdx_has_them() {
    let allowed = BTreeSet::from(["MIT", "Apache-2.0 WITH LLVM-exception"]);
    for (expression, met) in [
        ("MIT", true),
        ("GPL-3.0", false),
        ("GPL-3.0 OR MIT", true),
        ("GPL-3.0/MIT", true),
        ("MIT AND GPL-3.0", false),
        ("(GPL-3.0 OR MIT) AND MIT", true),
        ("(GPL-3.0 OR MIT) AND BSD-2-Clause", false),
        ("Apache-2.0 WITH LLVM-exception", true),
        ("Apache-2.0", false),
        ("MIT OR GPL-3.0 AND BSD-2-Clause", true),
    ] {
        assert_eq!(is_met(expression, &allowed), met, "{expression}");
    }
}
