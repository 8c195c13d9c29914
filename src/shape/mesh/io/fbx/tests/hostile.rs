//! Files that are damaged or made to harm.

use super::*;

/// A file of one record with one value, as stored.
fn raw(name: &str, values: &[u8]) -> Vec<u8> {
    let mut bytes = b"Kaydara FBX Binary  \0\x1a\0".to_vec();
    bytes.extend(7400_u32.to_le_bytes());
    let end = bytes.len() + 13 + name.len() + values.len();
    for number in [end, 1, values.len()] {
        bytes.extend((number as u32).to_le_bytes());
    }
    bytes.push(name.len() as u8);
    bytes.extend(name.bytes());
    bytes.extend(values);
    bytes.extend([0; 13]);
    bytes
}

#[test]
fn text_and_other_versions_are_refused_with_the_remedy() {
    let text = fault_of(b"; FBX 7.4.0 project file\nObjects:  {\n}\n");
    assert!(text.contains("text (ASCII)") && text.contains("assimp export"), "{text}");
    assert!(fault_of(b"\0\x01\x02").contains("does not begin with"));
    let old = fault_of(&character().bytes(Form { version: 6100, pack: None }));
    assert!(old.contains("version 6100 (expected 7000 to 7700)"), "{old}");
    let mut big = character().bytes(PLAIN);
    big[22] = 1;
    assert!(fault_of(&big).contains("big-endian"));
}

#[test]
fn a_file_that_is_cut_short_anywhere_is_refused_or_read_without_a_panic() {
    let bytes = character().bytes(Form { version: 7500, pack: Some(zlib) });
    for end in 0..bytes.len() {
        let _ = decode(&bytes[..end]);
    }
    let cut = fault_of(&bytes[..bytes.len() / 2]);
    assert!(cut.starts_with("FBX, byte ") && cut.contains("beyond the end"), "{cut}");
}

#[test]
fn changed_bytes_never_make_the_reader_panic() {
    let examples = [PLAIN, Form { version: 7700, pack: Some(writer::stored) }].map(|form| character().bytes(form));
    let mut random = fastrand::Rng::with_seed(5);
    for round in 0..2_000 {
        let mut bytes = examples[round % 2].clone();
        for _ in 0..random.usize(1..4) {
            let at = random.usize(0..bytes.len());
            match random.u8(0..4) {
                0 => bytes[at] ^= 1 << random.u8(0..8),
                1 => bytes[at] = random.u8(..),
                2 => bytes[at] = *random.choice(b"CYILFDSRbilfd\0\xff").expect("some"),
                _ => drop(bytes.drain(at..(at + random.usize(1..20)).min(bytes.len()))),
            }
        }
        let _ = decode(&bytes);
    }
}

#[test]
fn arrays_that_announce_more_than_they_hold_are_refused() {
    let array = |count: u32, encoding: u32, bytes: &[u8]| {
        let mut values = vec![b'd'];
        values.extend([count, encoding, bytes.len() as u32].iter().flat_map(|n| n.to_le_bytes()));
        values.extend(bytes);
        raw("Vertices", &values)
    };
    assert!(fault_of(&array(u32::MAX, 0, &[0; 24])).contains("they do not fit"));
    assert!(fault_of(&array(u32::MAX, 1, &zlib(&[0; 24]))).contains("they do not fit"));
    assert!(fault_of(&array(3, 7, &[0; 24])).contains("unknown encoding 7"));
    let strange = fault_of(&raw("A", b"?"));
    assert!(strange.contains("unknown type '?'") && strange.contains("byte 41"), "{strange}");
}

#[test]
fn bombs_of_compression_are_refused_before_they_are_unpacked() {
    // 24 MiB of zeros in 24 kB.
    let mut scene = Scene::default();
    let model = scene.model("a", 0, Vec::new());
    let zeros = leaf("Vertices", Value::Doubles(vec![0.0; 3 << 20]));
    let mesh = scene.object("Geometry", "", "Mesh", vec![zeros]);
    scene.connect(mesh, model);
    let bytes = scene.bytes(Form { version: 7400, pack: Some(zlib) });
    assert!(bytes.len() < 1 << 17, "{}", bytes.len());
    assert!(fault_of(&bytes).contains("bytes of arrays are read of a file of"), "{}", fault_of(&bytes));
    // A stream that unpacks to more or less than announced.
    for length in [23, 25, 1000] {
        let mut values = vec![b'd'];
        let packed = zlib(&vec![0; length]);
        values.extend([3, 1, packed.len() as u32].iter().flat_map(|n| n.to_le_bytes()));
        values.extend(packed);
        let mut scene = Scene::default();
        let model = scene.model("a", 0, Vec::new());
        let mesh = scene.object("Geometry", "", "Mesh", vec![leaf("Vertices", Value::Doubles(vec![0.0; 3]))]);
        scene.connect(mesh, model);
        let plain = scene.bytes(Form { version: 7400, pack: Some(|_| zlib(&[0; 24])) });
        let at = plain.windows(8).position(|w| w == b"Vertices").expect("its name") + 8;
        // In the place of the array; the length of the record is that of the shorter one.
        let changed = [&plain[..at], &values, &plain[at..]].concat();
        assert!(decode(&changed).is_err());
    }
}

#[test]
fn many_references_to_one_large_object_are_refused() {
    let mut scene = triangle_at(Vec::new());
    let points = vec![[0.0; 3]; 20_000];
    let first = scene.model("first", 0, Vec::new());
    let mesh = scene.mesh(first, &points, &[&[0, 1, 2]], Vec::new());
    for _ in 0..500 {
        let model = scene.model("copy", 0, Vec::new());
        scene.connect(mesh, model);
    }
    assert!(fault_of(&scene.bytes(PLAIN)).contains("with fewer copies"));
}

#[test]
fn deep_records_and_cycles_of_nodes_are_refused() {
    let mut deep = leaf("A", Value::Int(1));
    for _ in 0..100 {
        deep = node("A", Vec::new(), vec![deep]);
    }
    assert!(fault_of(&file(PLAIN, &[deep])).contains("records more than 64 deep"));
    let mut scene = triangle_at(Vec::new());
    let child = scene.model("child", 1000, Vec::new());
    scene.connect(1000, child);
    let told = fault_of(&scene.bytes(PLAIN));
    assert!(told.contains("is its own ancestor") && told.contains("Model"), "{told}");
    // A long chain of nodes is no problem.
    let mut scene = triangle_at(Vec::new());
    let mut last = 1000;
    for _ in 0..20_000 {
        last = scene.model("n", last, vec![p("Lcl Translation", &[0.0, 1.0, 0.0])]);
    }
    scene.mesh(last, &TRIANGLE, &[&[0, 1, 2]], Vec::new());
    assert!((read_scene(&scene).mesh().positions()[3].y - 20_000.0).abs() < 1e-6);
}

#[test]
fn faults_name_the_object_and_the_value() {
    let told = |change: &dyn Fn(&mut Scene)| {
        let mut scene = triangle_at(Vec::new());
        change(&mut scene);
        fault_of(&scene.bytes(PLAIN))
    };
    let mesh = |points: &'static [[f64; 3]], polygons: &'static [&'static [i32]]| {
        told(&move |scene| {
            scene.mesh(1000, points, polygons, Vec::new());
            // The new mesh first.
            scene.connections.swap(1, 2);
        })
    };
    let beyond = mesh(&TRIANGLE, &[&[0, 1, 7]]);
    assert!(beyond.ends_with("Geometry \"\": polygon 0 names vertex 7, but there are 3, numbered from 0"), "{beyond}");
    assert!(mesh(&[[0.0, f64::NAN, 0.0]], &[]).contains("not finite"));
    let twice = told(&|scene| {
        let object = scene.objects[0].clone();
        scene.objects.push(object);
    });
    assert!(twice.contains("a second object of number 1000"), "{twice}");
    let skinned = |weights: &[(i32, f64)]| {
        let identity: [f64; 16] = Matrix4::identity().as_slice().try_into().expect("sixteen");
        told(&|scene| {
            let joint = scene.model("joint", 0, Vec::new());
            let skin = scene.skin(1001);
            scene.cluster(skin, joint, weights, [identity, identity]);
        })
    };
    assert!(skinned(&[(5, 1.0)]).contains("its skin names vertex 5, but it has 3"));
    assert!(skinned(&[(-2, 1.0)]).contains("names vertex -2"));
    assert!(skinned(&[(0, f64::INFINITY)]).contains("weight inf (expected 0 or more)"));
    let far = told(&|scene| {
        scene.settings = vec![p("UnitScaleFactor", &[1e308])];
        let model = scene.model("far", 0, vec![p("Lcl Translation", &[1e10, 0.0, 0.0])]);
        scene.mesh(model, &TRIANGLE, &[&[0, 1, 2]], Vec::new());
    });
    assert!(far.contains("too large for a number"), "{far}");
}
