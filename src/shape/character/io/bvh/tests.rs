use std::collections::HashSet;

use nalgebra::Vector3;
use plumbline_num::math::Trs;
use proptest::prelude::*;

use super::*;
use crate::character::{Joint, Skeleton};

fn joint(name: &str, parent: Option<u32>, at: [f64; 3]) -> Joint {
    Joint { name: name.to_owned(), parent, rest: Trs::from_translation(at.into()), limits: None }
}

/// The name as a file holds it.
fn held(name: &str) -> String {
    let name = name.split_whitespace().collect::<Vec<_>>().join(" ");
    if name.is_empty() { "_".to_owned() } else { name }
}

/// Name, name of the parent and offset of each joint, sorted.
fn told(skeleton: &Skeleton) -> Vec<(String, Option<String>, [f64; 3])> {
    let name = |j: u32| held(&skeleton.joints()[j as usize].name);
    let of = |j: &Joint| (held(&j.name), j.parent.map(name), j.rest.translation.into());
    let mut told: Vec<_> = skeleton.joints().iter().map(of).collect();
    told.sort_by(|a, b| a.0.cmp(&b.0));
    told
}

/// Names of any characters, of braces and words of the format, of up to some thousand bytes, and such as ends have.
fn names() -> impl Strategy<Value = String> {
    let word = prop_oneof![
        Just("{"),
        Just("}"),
        Just("End"),
        Just("end"),
        Just("JOINT"),
        Just(" "),
        Just("\u{2028}"),
        Just("é")
    ];
    let words = prop::collection::vec(word, 0..6).prop_map(|words| words.join(" "));
    let long = ("[a-z\u{ffff} ]{1,4}", 1..900_usize).prop_map(|(part, times)| part.repeat(times));
    prop_oneof![any::<String>(), words, long]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn what_is_written_is_read_back_with_its_names(
        described in prop::collection::vec((names(), any::<u32>(), any::<bool>(), prop::array::uniform3(-2_i8..3)), 1..12),
    ) {
        let mut joints: Vec<Joint> = Vec::new();
        for (name, parent, ends, at) in &described {
            let parent = (!joints.is_empty()).then(|| parent % joints.len() as u32);
            let name = parent.filter(|_| *ends).map_or(name.clone(), |p| format!("{}{END}", joints[p as usize].name));
            joints.push(joint(&name, parent, at.map(f64::from)));
        }
        let names: HashSet<String> = joints.iter().map(|j| held(&j.name)).collect();
        prop_assume!(names.len() == joints.len());
        let skeleton = Skeleton::new(joints).expect("a tree");
        let (text, _) = bvh_text(&skeleton, None).expect("one root");
        let read = parse_bvh(&text).expect("own files are read");
        prop_assert_eq!(told(&read.skeleton), told(&skeleton));
        let (again, _) = bvh_text(&read.skeleton, read.clips.first()).expect("one root");
        prop_assert_eq!(told(&parse_bvh(&again).expect("own files are read").skeleton), told(&skeleton));
    }
}

#[test]
fn an_end_named_after_a_long_name_is_written_and_read() {
    // Of two ends of one joint neither is an end site: both are written by their names, longer than that of any joint read.
    let text = format!(
        "HIERARCHY\nROOT {}\n{{\nEnd Site\n{{\nOFFSET 1 0 0\n}}\nEnd Site\n{{\nOFFSET 0 1 0\n}}\n}}\nMOTION\nFrames: 0\nFrame Time: 1\n",
        "é".repeat(512)
    );
    let read = parse_bvh(&text).expect("a name of 1024 bytes");
    let (text, _) = bvh_text(&read.skeleton, None).expect("one root");
    assert_eq!(told(&parse_bvh(&text).expect("own files are read").skeleton), told(&read.skeleton));
}

#[test]
fn copies_of_a_long_name_are_bounded_by_the_file() {
    let site = "End Site\n{\nOFFSET 1 0 0\n}\n";
    let named = |bytes: usize, ends: usize| {
        let (name, sites) = ("a".repeat(bytes), site.repeat(ends));
        parse_bvh(&format!("HIERARCHY\nROOT {name}\n{{\n{sites}}}\nMOTION\nFrames: 0\nFrame Time: 1\n"))
    };
    assert_eq!(named(2000, 1000).expect("two megabytes of names").skeleton.joint_count(), 1001);
    let refused = named(200_000, 1000).expect_err("200 MB of names in a file of .2 MB").to_string();
    assert!(refused.contains("shorten the names") && refused.len() < 300, "{refused}");
}

#[test]
fn a_skeleton_that_could_not_be_read_back_is_not_written() {
    let chain = |joints: u32| {
        let of = |k: u32| joint(&k.to_string(), k.checked_sub(1), [0.0, f64::from(k), 0.0]);
        bvh_text(&Skeleton::new((0..joints).map(of).collect()).expect("a chain"), None)
    };
    let deepest = MAX_DEPTH as u32;
    let (text, _) = chain(deepest).expect("as deep as may be");
    assert_eq!(parse_bvh(&text).expect("own files are read").skeleton.joint_count(), MAX_DEPTH);
    assert!(text.len() < MAX_DEPTH * 500, "{} bytes", text.len());
    assert!(chain(deepest + 1).expect_err("too deep").to_string().contains("one below the other"));
    let turned = |at| {
        let mut root = joint("a", None, [0.0; 3]);
        root.rest.rotation = nalgebra::UnitQuaternion::from_euler_angles(0.3, 0.7, 0.2);
        bvh_text(&Skeleton::new(vec![root, joint("b", Some(0), at)]).expect("finite"), None)
    };
    assert!(turned([1e308; 3]).is_ok());
    let refused = turned(Vector3::repeat(f64::MAX).into()).expect_err("beyond double precision").to_string();
    assert!(refused.contains("scale it"), "{refused}");
}
