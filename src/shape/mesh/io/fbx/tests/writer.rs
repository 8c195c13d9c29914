//! A writer of binary FBX files, for tests: records from a tree, and scenes of objects and connections. Needs the standard library only,
//! so that tests of the program may use it too.

/// A value of a record.
#[derive(Clone, Debug)]
pub(crate) enum Value {
    Int(i32),
    Long(i64),
    Double(f64),
    Text(Vec<u8>),
    Ints(Vec<i32>),
    Longs(Vec<i64>),
    Floats(Vec<f32>),
    Doubles(Vec<f64>),
}

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Self::Text(text.as_bytes().to_vec())
    }
}

/// A record.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub(crate) name: String,
    pub(crate) values: Vec<Value>,
    pub(crate) children: Vec<Node>,
}

pub(crate) fn node(name: &str, values: Vec<Value>, children: Vec<Node>) -> Node {
    Node { name: name.to_owned(), values, children }
}

/// A record with one value.
pub(crate) fn leaf(name: &str, value: impl Into<Value>) -> Node {
    node(name, vec![value.into()], Vec::new())
}

/// Compresses the bytes of an array.
pub(crate) type Pack = fn(&[u8]) -> Vec<u8>;

/// How records are written.
#[derive(Clone, Copy)]
pub(crate) struct Form {
    pub(crate) version: u32,
    pub(crate) pack: Option<Pack>,
}

/// A file of the records.
pub(crate) fn file(form: Form, nodes: &[Node]) -> Vec<u8> {
    let mut bytes = b"Kaydara FBX Binary  \0\x1a\0".to_vec();
    bytes.extend(form.version.to_le_bytes());
    for each in nodes {
        record(form, each, &mut bytes);
    }
    bytes.resize(bytes.len() + null(form), 0);
    // The footer: any bytes.
    bytes.extend([0xfa; 16]);
    bytes
}

/// Length of the record at the end of a list.
fn null(form: Form) -> usize {
    if form.version >= 7500 { 25 } else { 13 }
}

fn record(form: Form, node: &Node, bytes: &mut Vec<u8>) {
    let start = bytes.len();
    let width = if form.version >= 7500 { 8 } else { 4 };
    let put = |bytes: &mut Vec<u8>, at: usize, number: usize| {
        bytes[at..at + width].copy_from_slice(&(number as u64).to_le_bytes()[..width]);
    };
    bytes.resize(start + 3 * width, 0);
    bytes.push(node.name.len() as u8);
    bytes.extend(node.name.bytes());
    let values = bytes.len();
    node.values.iter().for_each(|v| value(form, v, bytes));
    put(bytes, start + width, node.values.len());
    let length = bytes.len() - values;
    put(bytes, start + 2 * width, length);
    if !node.children.is_empty() {
        node.children.iter().for_each(|child| record(form, child, bytes));
        bytes.resize(bytes.len() + null(form), 0);
    }
    let end = bytes.len();
    put(bytes, start, end);
}

fn value(form: Form, value: &Value, bytes: &mut Vec<u8>) {
    match value {
        Value::Int(x) => single(b'I', x.to_le_bytes(), bytes),
        Value::Long(x) => single(b'L', x.to_le_bytes(), bytes),
        Value::Double(x) => single(b'D', x.to_le_bytes(), bytes),
        Value::Text(text) => {
            single(b'S', (text.len() as u32).to_le_bytes(), bytes);
            bytes.extend(text);
        }
        Value::Ints(all) => array(form, b'i', all.iter().map(|x| x.to_le_bytes()), bytes),
        Value::Longs(all) => array(form, b'l', all.iter().map(|x| x.to_le_bytes()), bytes),
        Value::Floats(all) => array(form, b'f', all.iter().map(|x| x.to_le_bytes()), bytes),
        Value::Doubles(all) => array(form, b'd', all.iter().map(|x| x.to_le_bytes()), bytes),
    }
}

fn single<const N: usize>(kind: u8, number: [u8; N], bytes: &mut Vec<u8>) {
    bytes.push(kind);
    bytes.extend(number);
}

fn array<const N: usize>(form: Form, kind: u8, elements: impl Iterator<Item = [u8; N]>, bytes: &mut Vec<u8>) {
    let elements: Vec<[u8; N]> = elements.collect();
    let plain = elements.as_flattened();
    let packed = form.pack.map_or_else(|| plain.to_vec(), |pack| pack(plain));
    single(kind, (elements.len() as u32).to_le_bytes(), bytes);
    bytes.extend(u32::from(form.pack.is_some()).to_le_bytes());
    bytes.extend((packed.len() as u32).to_le_bytes());
    bytes.extend(packed);
}

/// A zlib stream that stores the bytes.
pub(crate) fn stored(bytes: &[u8]) -> Vec<u8> {
    let mut stream = vec![0x78, 0x01];
    let mut chunks = bytes.chunks(0xffff).peekable();
    if bytes.is_empty() {
        stream.extend([1, 0, 0, 0xff, 0xff]);
    }
    while let Some(chunk) = chunks.next() {
        stream.push(u8::from(chunks.peek().is_none()));
        let length = chunk.len() as u16;
        stream.extend(length.to_le_bytes());
        stream.extend((!length).to_le_bytes());
        stream.extend(chunk);
    }
    let sums = bytes.iter().fold([1_u32, 0], |[a, b], &byte| {
        let a = (a + u32::from(byte)) % 65521;
        [a, (a + b) % 65521]
    });
    stream.extend((sums[1] << 16 | sums[0]).to_be_bytes());
    stream
}

/// A property of numbers.
pub(crate) fn p(name: &str, numbers: &[f64]) -> Node {
    let mut values = vec![Value::from(name), "Vector3D".into(), "Vector".into(), "".into()];
    values.extend(numbers.iter().map(|&x| Value::Double(x)));
    node("P", values, Vec::new())
}

/// A property of an integer.
pub(crate) fn whole(name: &str, number: i32) -> Node {
    node("P", vec![name.into(), "int".into(), "Integer".into(), "".into(), Value::Int(number)], Vec::new())
}

pub(crate) fn properties(all: Vec<Node>) -> Node {
    node("Properties70", Vec::new(), all)
}

/// Objects and connections of a file.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scene {
    pub(crate) settings: Vec<Node>,
    pub(crate) definitions: Vec<Node>,
    pub(crate) objects: Vec<Node>,
    pub(crate) connections: Vec<Node>,
}

/// Ticks of a second.
const TICKS: f64 = 46_186_158_000.0;

impl Scene {
    pub(crate) fn bytes(&self, form: Form) -> Vec<u8> {
        let nodes = [
            node("FBXHeaderExtension", Vec::new(), vec![leaf("FBXVersion", Value::Int(form.version as i32))]),
            node("GlobalSettings", Vec::new(), vec![properties(self.settings.clone())]),
            node("Definitions", Vec::new(), self.definitions.clone()),
            node("Objects", Vec::new(), self.objects.clone()),
            node("Connections", Vec::new(), self.connections.clone()),
        ];
        file(form, &nodes)
    }

    /// Adds an object; returns its number.
    pub(crate) fn object(&mut self, kind: &str, name: &str, subtype: &str, children: Vec<Node>) -> i64 {
        let number = 1000 + self.objects.len() as i64;
        let name = Value::Text([name.as_bytes(), b"\0\x01", kind.as_bytes()].concat());
        self.objects.push(node(kind, vec![Value::Long(number), name, subtype.into()], children));
        number
    }

    /// Adds a node of the hierarchy below `parent`, or below the root 0.
    pub(crate) fn model(&mut self, name: &str, parent: i64, parts: Vec<Node>) -> i64 {
        let model = self.object("Model", name, "LimbNode", vec![properties(parts)]);
        self.connect(model, parent);
        model
    }

    /// Adds a mesh at a node. The last index of each polygon is stored as its complement.
    pub(crate) fn mesh(&mut self, model: i64, points: &[[f64; 3]], polygons: &[&[i32]], more: Vec<Node>) -> i64 {
        let mut indices: Vec<i32> = Vec::new();
        for polygon in polygons {
            indices.extend(*polygon);
            if let Some(last) = indices.last_mut() {
                *last = !*last;
            }
        }
        let mut children = vec![
            leaf("Vertices", Value::Doubles(points.as_flattened().to_vec())),
            leaf("PolygonVertexIndex", Value::Ints(indices)),
        ];
        children.extend(more);
        let mesh = self.object("Geometry", "", "Mesh", children);
        self.connect(mesh, model);
        mesh
    }

    /// Adds a skin to a mesh.
    pub(crate) fn skin(&mut self, mesh: i64) -> i64 {
        let skin = self.object("Deformer", "", "Skin", Vec::new());
        self.connect(skin, mesh);
        skin
    }

    /// Adds a joint with its weights to a skin. Matrices column by column.
    pub(crate) fn cluster(
        &mut self,
        skin: i64,
        joint: i64,
        weights: &[(i32, f64)],
        [transform, link]: [[f64; 16]; 2],
    ) -> i64 {
        let cluster = self.object(
            "Deformer",
            "",
            "Cluster",
            vec![
                leaf("Indexes", Value::Ints(weights.iter().map(|w| w.0).collect())),
                leaf("Weights", Value::Doubles(weights.iter().map(|w| w.1).collect())),
                leaf("Transform", Value::Doubles(transform.to_vec())),
                leaf("TransformLink", Value::Doubles(link.to_vec())),
            ],
        );
        self.connect(cluster, skin);
        self.connect(joint, cluster);
        cluster
    }

    /// Adds a stack with one layer; returns the layer.
    pub(crate) fn animation(&mut self, name: &str) -> i64 {
        let stack = self.object("AnimationStack", name, "", Vec::new());
        let layer = self.object("AnimationLayer", "", "", Vec::new());
        self.connect(layer, stack);
        layer
    }

    /// Adds curves of a property, one for each axis (`d|X` …) that has keys.
    pub(crate) fn curves(&mut self, layer: i64, moved: (i64, &str), curves: &[(&str, Vec<Key>)]) -> i64 {
        let curve_node = self.object("AnimationCurveNode", "", "", Vec::new());
        self.connect(curve_node, layer);
        self.connect_property(curve_node, moved.0, moved.1);
        for (axis, keys) in curves {
            let data = keys.iter().flat_map(|k| [k.slopes[0], k.slopes[1], f32::from_bits(k.weights), 0.0]).collect();
            let curve = self.object(
                "AnimationCurve",
                "",
                "",
                vec![
                    leaf("KeyTime", Value::Longs(keys.iter().map(|k| (k.time * TICKS).round() as i64).collect())),
                    leaf("KeyValueFloat", Value::Floats(keys.iter().map(|k| k.value).collect())),
                    leaf("KeyAttrFlags", Value::Ints(keys.iter().map(|k| k.flags).collect())),
                    leaf("KeyAttrDataFloat", Value::Floats(data)),
                    leaf("KeyAttrRefCount", Value::Ints(vec![1; keys.len()])),
                ],
            );
            self.connect_property(curve, curve_node, axis);
        }
        curve_node
    }

    pub(crate) fn connect(&mut self, child: i64, parent: i64) {
        self.connections.push(node("C", vec!["OO".into(), Value::Long(child), Value::Long(parent)], Vec::new()));
    }

    pub(crate) fn connect_property(&mut self, child: i64, parent: i64, property: &str) {
        let values = vec!["OP".into(), Value::Long(child), Value::Long(parent), property.into()];
        self.connections.push(node("C", values, Vec::new()));
    }
}

/// A key of a curve.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Key {
    pub(crate) time: f64,
    pub(crate) value: f32,
    pub(crate) flags: i32,
    /// Slope after the key and before the next.
    pub(crate) slopes: [f32; 2],
    pub(crate) weights: u32,
}

/// A key of a linear curve.
pub(crate) fn linear(time: f64, value: f32) -> Key {
    Key { time, value, flags: 0x4, ..Key::default() }
}

/// A rectangle of two polygons on two joints, with layers, a blend shape and an animation of everything.
pub(crate) fn character() -> Scene {
    let identity = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let at = |x: f64| {
        let mut matrix = identity;
        matrix[12] = x;
        matrix
    };
    let mut scene = Scene { settings: vec![p("UnitScaleFactor", &[100.0])], ..Scene::default() };
    let body = scene.model("body", 0, Vec::new());
    let layer = |name: &str, mapping: &str, children: Vec<Node>| {
        let reference = if children.len() > 1 { "IndexToDirect" } else { "Direct" };
        let described = [leaf("MappingInformationType", mapping), leaf("ReferenceInformationType", reference)];
        node(name, vec![Value::Int(0)], described.into_iter().chain(children).collect())
    };
    let more = vec![
        layer("LayerElementNormal", "ByVertice", vec![leaf("Normals", Value::Doubles([0.0, 0.0, 1.0].repeat(6)))]),
        layer(
            "LayerElementUV",
            "ByPolygonVertex",
            vec![
                leaf("UV", Value::Doubles(vec![0.0, 0.0, 1.0, 0.0, 1.0, 1.0])),
                leaf("UVIndex", Value::Ints(vec![0, 1, 2, 0, 1, 2, 0, 1])),
            ],
        ),
        layer("LayerElementColor", "ByPolygon", vec![leaf("Colors", Value::Doubles([1.0, 0.5, 0.0, 1.0].repeat(2)))]),
        layer("LayerElementMaterial", "AllSame", vec![leaf("Materials", Value::Ints(vec![0]))]),
    ];
    let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [2.0, 1.0, 0.0]];
    let mesh = scene.mesh(body, &points, &[&[0, 1, 4, 3], &[1, 2, 5, 4]], more);
    let material = scene.object("Material", "skin", "", Vec::new());
    scene.connect(material, body);
    let shoulder = scene.model("shoulder", 0, vec![whole("RotationOrder", 2)]);
    let elbow = scene.model(
        "elbow",
        shoulder,
        vec![p("Lcl Translation", &[1.0, 0.0, 0.0]), p("RotationPivot", &[0.0, 0.1, 0.0]), whole("InheritType", 0)],
    );
    let skin = scene.skin(mesh);
    scene.cluster(skin, shoulder, &[(0, 1.0), (1, 0.5), (3, 1.0), (4, 0.5)], [identity, identity]);
    scene.cluster(skin, elbow, &[(1, 0.5), (2, 1.0), (4, 0.5), (5, 1.0)], [at(-1.0), at(1.0)]);
    let blend = scene.object("Deformer", "", "BlendShape", Vec::new());
    scene.connect(blend, mesh);
    let channel =
        scene.object("Deformer", "bulge", "BlendShapeChannel", vec![leaf("DeformPercent", Value::Double(25.0))]);
    scene.connect(channel, blend);
    let shape = scene.object(
        "Geometry",
        "",
        "Shape",
        vec![
            leaf("Indexes", Value::Ints(vec![4, 1])),
            leaf("Vertices", Value::Doubles(vec![0.0, 0.0, 1.0, 0.0, 0.0, 2.0])),
        ],
    );
    scene.connect(shape, channel);
    let animation = scene.animation("bend");
    let cubic = |time: f64, value: f32| Key { time, value, flags: 0x408, slopes: [30.0, -10.0], weights: 0 };
    scene.curves(
        animation,
        (elbow, "Lcl Rotation"),
        &[("d|Z", vec![cubic(0.0, 0.0), cubic(0.5, 80.0), linear(1.0, 10.0)]), ("d|X", vec![linear(0.25, 20.0)])],
    );
    scene.curves(animation, (shoulder, "Lcl Translation"), &[("d|Y", vec![linear(0.0, 0.0), linear(1.0, 1.0)])]);
    scene.curves(
        animation,
        (shoulder, "Lcl Scaling"),
        &[("d|X", vec![Key { flags: 2, value: 2.0, ..Key::default() }])],
    );
    scene.curves(
        animation,
        (channel, "DeformPercent"),
        &[("d|DeformPercent", vec![linear(0.0, 0.0), linear(1.0, 100.0)])],
    );
    scene
}
