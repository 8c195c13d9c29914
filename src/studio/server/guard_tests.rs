//! Which requests are refused, and why.

use super::*;

fn headers(of: &[(&'static str, &str)]) -> HeaderMap {
    of.iter()
        .map(|(name, value)| (HeaderName::from_static(name), HeaderValue::from_str(value).expect("a value")))
        .collect()
}

fn is_allowed(hosts: &Hosts, path: &str, of: &[(&'static str, &str)]) -> bool {
    hosts.check(&Method::GET, path, &headers(of)).is_ok()
}

fn loopback() -> Hosts {
    Hosts::new("127.0.0.1", false).expect("loopback")
}

#[test]
fn only_names_of_this_machine_are_hosts() {
    let hosts = loopback();
    for host in ["127.0.0.1", "127.0.0.1:7811", "localhost", "LOCALHOST:1", "[::1]:7811"] {
        assert!(is_allowed(&hosts, "/", &[("host", host)]), "{host}");
    }
    for host in [
        "evil.example",
        "evil.example:7811",
        "localhost.evil.example",
        "127.0.0.1.evil.example",
        "127.0.0.2",
        "user@localhost",
        "localhost/",
        "localhost, evil.example",
        "",
        "0.0.0.0",
        "[::1",
    ] {
        assert!(!is_allowed(&hosts, "/", &[("host", host)]), "{host}");
    }
    assert!(!is_allowed(&hosts, "/", &[]), "no Host");
    let mut two = headers(&[("host", "localhost")]);
    two.append("host", HeaderValue::from_static("evil.example"));
    assert!(hosts.check(&Method::GET, "/", &two).is_err(), "two Hosts");
}

#[test]
fn only_our_own_origin_may_send() {
    let hosts = loopback();
    let from = |origin| is_allowed(&hosts, "/api/state", &[("host", "localhost:7811"), ("origin", origin)]);
    assert!(from("http://localhost:7811"));
    for origin in [
        "null",
        "",
        "http://localhost",
        "http://localhost:7812",
        "https://localhost:7811",
        "http://127.0.0.1:7811",
        "http://evil.example",
        "file://",
    ] {
        assert!(!from(origin), "{origin}");
    }
}

#[test]
fn requests_of_other_sites_are_refused_but_opening_the_page() {
    let hosts = loopback();
    let site = |path, site, mode, dest| {
        let of = [("host", "localhost"), ("sec-fetch-site", site), ("sec-fetch-mode", mode), ("sec-fetch-dest", dest)];
        is_allowed(&hosts, path, &of)
    };
    for own in ["same-origin", "none"] {
        assert!(site("/api/state", own, "cors", "empty"), "{own}");
    }
    for other in ["cross-site", "same-site", "?"] {
        assert!(!site("/api/state", other, "cors", "empty"), "{other}");
        assert!(!site("/ws", other, "websocket", "websocket"), "{other}");
        assert!(!site("/", other, "navigate", "iframe"), "{other}: in a frame");
        assert!(!site("/download/a", other, "navigate", "document"), "{other}");
        assert!(site("/", other, "navigate", "document"), "{other}: the redirect file");
    }
    let post = headers(&[
        ("host", "localhost"),
        ("sec-fetch-site", "cross-site"),
        ("sec-fetch-mode", "navigate"),
        ("sec-fetch-dest", "document"),
    ]);
    assert!(hosts.check(&Method::POST, "/", &post).is_err(), "a form");
}

#[test]
fn hosts_beyond_this_machine_need_a_certificate() {
    for host in ["0.0.0.0", "::", "192.168.1.2", "example.org", "127.0.0.1.evil.example"] {
        let refused = Hosts::new(host, false).expect_err(host).to_string();
        assert!(refused.contains("--cert and --key") && refused.contains("SSH"), "{refused}");
        assert!(Hosts::new(host, true).is_ok(), "{host}");
    }
    for host in ["127.0.0.1", "127.0.0.5", "::1", "[::1]", "localhost"] {
        assert!(Hosts::new(host, false).is_ok(), "{host}");
    }
}

#[test]
fn a_server_for_other_machines_is_called_by_its_name_or_any_number() {
    let named = Hosts::new("studio.example", true).expect("with a certificate");
    assert!(is_allowed(&named, "/", &[("host", "studio.example:7811")]));
    assert!(!is_allowed(&named, "/", &[("host", "evil.example:7811")]));
    let every = Hosts::new("0.0.0.0", true).expect("with a certificate");
    assert!(is_allowed(&every, "/", &[("host", "192.168.1.2:7811")]));
    assert!(!is_allowed(&every, "/", &[("host", "evil.example:7811")]));
}
