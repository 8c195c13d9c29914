//! Shared folders that are elsewhere on another machine: prefixes of paths, rewritten.
//!
//! Paths below the root of a plan start from the root, wherever it is mounted. Those outside are absolute; a rule `FROM=TO` replaces
//! the folder `FROM` at their beginning by `TO`. Folders are compared by whole components (`/mnt/media` is no prefix of
//! `/mnt/media2/a.mp4`), and of several that fit the longest counts. Each path is rewritten once.
//!
//! A rule gives no permission: results are written below the root, or below the folders of the command line, where they are after
//! they were rewritten. A path that would leave its mapped folder by `..` is refused.

use std::path::{Component, Path, PathBuf};

use super::Task;
use crate::pipeline::paths::{shown, to_path, to_text};
use crate::pipeline::setting_paths::for_each_path;

/// The variable that holds the rules of a machine, separated as the folders of `PATH` are.
pub const PATH_MAP_VARIABLE: &str = "PLUMBLINE_PATH_MAP";

/// Most rules: a machine has a few mounted folders.
const MAX_RULES: usize = 256;

/// A folder of the plan, and where it is on this machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PathRule {
    from: PathBuf,
    to: PathBuf,
}

impl PathRule {
    /// Reads `FROM=TO`, two absolute folders as the text of a setting.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn parse(text: &str) -> Result<Self, String> {
        let halves = text.match_indices('=').map(|(at, _)| (to_path(&text[..at]), to_path(&text[at + 1..])));
        let mut found = halves.filter(|(from, to)| from.is_absolute() && to.is_absolute());
        let expected = "expected FROM=TO, two absolute folders";
        let Some((from, to)) = found.next() else { return Err(format!("`{}`: {expected}", shown(text))) };
        if found.next().is_some() {
            return Err(format!("`{}` can be read in two senses: {expected}, without `=` before a `/`", shown(text)));
        }
        if [&from, &to].iter().any(|folder| has_parent(folder)) {
            return Err(format!("`{}`: {expected}, without `..`", shown(text)));
        }
        Ok(Self { from, to })
    }

    /// The rule as text, which [`Self::parse`] reads.
    pub fn to_text(&self) -> String {
        format!("{}={}", to_text(&self.from), to_text(&self.to))
    }
}

fn has_parent(path: &Path) -> bool {
    path.components().any(|part| part == Component::ParentDir)
}

/// The rules of a machine.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PathMap {
    rules: Vec<PathRule>,
}

impl PathMap {
    /// The rules of a command line.
    ///
    /// # Errors
    /// A folder that is mapped to two others; too many rules.
    pub fn new(rules: Vec<PathRule>) -> Result<Self, String> {
        if rules.len() > MAX_RULES {
            return Err(format!("{} folders are mapped (expected {MAX_RULES} or fewer)", rules.len()));
        }
        for (at, rule) in rules.iter().enumerate() {
            if let Some(other) = rules[..at].iter().find(|other| other.from == rule.from && other.to != rule.to) {
                let (from, to, then) = (rule.from.display(), other.to.display(), rule.to.display());
                return Err(format!("the folder `{from}` is mapped to `{to}` and to `{then}`"));
            }
        }
        Ok(Self { rules })
    }

    /// Adds the rules of the variable [`PATH_MAP_VARIABLE`], whose value is `value`; a folder that is mapped already stays so.
    ///
    /// # Errors
    /// As [`PathRule::parse`] and [`Self::new`].
    pub fn with_variable(self, value: Option<&std::ffi::OsStr>) -> Result<Self, String> {
        let named = |fault: String| format!("{PATH_MAP_VARIABLE}: {fault}");
        let texts = value.into_iter().flat_map(std::env::split_paths).filter(|text| text.as_os_str() != "");
        let of_machine = texts.map(|text| PathRule::parse(&to_text(text))).collect::<Result<Vec<_>, _>>();
        let of_machine = Self::new(of_machine.map_err(named)?).map_err(named)?;
        let is_new = |rule: &PathRule| !self.rules.iter().any(|own| own.from == rule.from);
        let added: Vec<PathRule> = of_machine.rules.into_iter().filter(is_new).collect();
        Self::new(self.rules.into_iter().chain(added).collect())
    }

    /// The rules.
    pub fn rules(&self) -> &[PathRule] {
        &self.rules
    }

    /// The path as this machine has it; one that no rule is for stays.
    ///
    /// # Errors
    /// A path that leaves its mapped folder.
    pub fn apply(&self, path: &Path) -> Result<PathBuf, String> {
        let fits = self.rules.iter().filter_map(|rule| Some((rule, path.strip_prefix(&rule.from).ok()?)));
        // The longest folder leaves the fewest components.
        let Some((rule, rest)) = fits.min_by_key(|(_, rest)| rest.components().count()) else {
            return Ok(path.to_owned());
        };
        if has_parent(rest) {
            let (path, from) = (path.display(), rule.from.display());
            return Err(format!("`{path}` leaves the folder `{from}`, which is mapped, by `..`"));
        }
        // Joining nothing would add a separator.
        Ok(if rest == Path::new("") { rule.to.clone() } else { rule.to.join(rest) })
    }

    fn apply_to(&self, text: &mut String) -> Result<(), String> {
        let path = to_path(text);
        let mapped = self.apply(&path)?;
        if mapped != path {
            *text = to_text(mapped);
        }
        Ok(())
    }
}

impl Task {
    /// Rewrites the paths of the task to those of this machine: what it reads, what it writes, and those among its settings.
    ///
    /// # Errors
    /// A path that leaves its mapped folder.
    pub fn map_paths(&mut self, map: &PathMap) -> Result<(), String> {
        if map.rules.is_empty() {
            return Ok(());
        }
        let texts = self.inputs.iter_mut().map(|input| &mut input.path).chain(&mut self.outputs);
        texts.into_iter().try_for_each(|text| map.apply_to(text))?;
        for folder in &mut self.order.options.allow_paths {
            *folder = map.apply(folder)?;
        }
        for (kind, settings) in self.order.kinds_and_settings() {
            // A kind that is unknown is reported where the task is run.
            let Some(kind) = kind else { continue };
            for_each_path(&kind.json_schema(), settings, &mut |text, _| map.apply_to(text))?;
        }
        Ok(())
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    fn map(rules: &[&str]) -> PathMap {
        PathMap::new(rules.iter().map(|rule| PathRule::parse(rule).expect(rule)).collect()).expect("a map")
    }

    #[test]
    fn the_longest_folder_of_whole_components_counts() {
        let map = map(&["/mnt/media=/Volumes/media", "/mnt/media/raw/=/raw", "/=/host"]);
        for (path, mapped) in [
            ("/mnt/media/a.mp4", "/Volumes/media/a.mp4"),
            ("/mnt/media", "/Volumes/media"),
            ("/mnt/media/raw/a b.mp4", "/raw/a b.mp4"),
            ("/mnt/media2/a.mp4", "/host/mnt/media2/a.mp4"),
            ("/mnt//media/./a.mp4", "/Volumes/media/a.mp4"),
            // Paths below the root are not rewritten.
            ("in/a.mp4", "in/a.mp4"),
            ("in/../a.mp4", "in/../a.mp4"),
            ("", ""),
            ("-", "-"),
        ] {
            assert_eq!(map.apply(Path::new(path)), Ok(PathBuf::from(mapped)), "{path}");
        }
        assert!(map.apply(Path::new("/mnt/media/../x")).expect_err("leaves").contains("by `..`"));
    }

    #[test]
    fn a_path_is_rewritten_once() {
        let map = map(&["/a=/b", "/b=/a"]);
        assert_eq!(map.apply(Path::new("/a/x")), Ok(PathBuf::from("/b/x")));
        assert_eq!(map.apply(Path::new("/b/x")), Ok(PathBuf::from("/a/x")));
    }

    #[test]
    fn rules_are_two_absolute_folders() {
        for (text, fault) in [
            ("", "expected FROM=TO"),
            ("/mnt", "expected FROM=TO"),
            ("mnt=/x", "expected FROM=TO"),
            ("/mnt=x", "expected FROM=TO"),
            ("/a=/b=/c", "two senses"),
            ("/a/..=/b", "without `..`"),
            ("/a=/b/../c", "without `..`"),
        ] {
            assert!(PathRule::parse(text).expect_err(text).contains(fault), "{text}");
        }
        for text in ["/a=/b", "/a=b=/c", "/süd und nord=/x"] {
            assert_eq!(PathRule::parse(text).map(|rule| rule.to_text()), Ok(text.to_owned()));
        }
        let rule = |text| PathRule::parse(text).expect("a rule");
        let twice = PathMap::new(vec![rule("/a=/b"), rule("/a=/c")]);
        assert!(twice.expect_err("two").contains("is mapped to `/b` and to `/c`"));
        assert!(PathMap::new(vec![rule("/a=/b"); MAX_RULES + 1]).is_err());
    }

    #[test]
    fn options_come_before_the_variable() {
        let map = map(&["/a=/b"]).with_variable(Some("/a=/c::/d=/e".as_ref())).expect("rules");
        assert_eq!(map.rules().iter().map(PathRule::to_text).collect::<Vec<_>>(), ["/a=/b", "/d=/e"]);
        let wrong = PathMap::default().with_variable(Some("x".as_ref()));
        assert!(wrong.expect_err("no rule").starts_with("PLUMBLINE_PATH_MAP: `x`: expected"));
    }
}
