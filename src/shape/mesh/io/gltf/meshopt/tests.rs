//! Streams of the encoder of meshoptimizer 1.3, npm package, and what its decoder makes of them.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use super::*;

const ATTRIBUTES: &str = "oAAAHwAgD4Dw7/DAvx+gIFDgyHgnDzAfZ4h4z2AAAFdICHiP//8AABA3EDhf0H9/HT/3DzuB/f/8BP99f/7///////wEA/sAAAAA\
    /AQD+//cAAD///////0AAB8AAOgH4JDfj3gfp0+ogHcfEJBnV0BwN5hvR+efH7+AIP//AAD/wHA/FzgYeBU4e//9//+AgP/+//3/\
    /8GDvt/9/v/8//v/cAEAAP0AAB8Ab3B3iOBvxzB3eEcQQH9v+OfAoM9QAD8ABydYJ8Bwz///AABwj/DvH/CwLxUf/9x+/f/+/v39\
    //3+/5//7HD9A/v////+///nzwAA//3+/f4AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAJA/AABIQA==";
const TRIANGLES: &str = "4f4eEA4QDhAOEA7+HhkOGA4XDhYO/x4WDhYOFg4WDv8eFg4WDhYOFg7//g8MnwJfCQxfCQz/ADMc/6gBAQB2h1ZneKmGZYlomAFp\
    AAA=";
const INDICES: &str = "0RQCCKEfBAUEnewQBBoAAAAA";

fn bytes(base64: &str) -> Vec<u8> {
    STANDARD.decode(base64).expect("base64")
}

fn compression(mode: Mode, filter: Filter, count: u64, byte_stride: u64) -> Compression {
    Compression { buffer: 0, byte_offset: 0, byte_length: 0, byte_stride, count, mode, filter }
}

fn decode(compression: &Compression, stream: &[u8]) -> Result<Vec<u8>, String> {
    compression.decode(stream, compression.count * compression.byte_stride, "/x").map_err(|e| e.to_string())
}

fn shorts(bytes: &[u8]) -> Vec<i16> {
    bytes.chunks_exact(2).map(|b| i16::from_le_bytes([b[0], b[1]])).collect()
}

#[test]
fn attributes_come_back_bit_for_bit() {
    let decoded = decode(&compression(Mode::Attributes, Filter::None, 40, 12), &bytes(ATTRIBUTES)).expect("valid");
    let value = |i: i32| ((50.0 * (f64::from(i * i) * 0.37).sin()) + 0.5).floor() / 16.0;
    let expected: Vec<f32> = (0..120).map(|i| value(i) as f32).collect();
    assert_eq!(bytemuck::pod_collect_to_vec::<u8, f32>(&decoded), expected);
}

#[test]
fn triangles_are_those_of_the_list_in_its_order() {
    let decoded = decode(&compression(Mode::Triangles, Filter::None, 126, 2), &bytes(TRIANGLES)).expect("valid");
    let quad = |a: i16| [[a, a + 1, a + 6], [a + 6, a + 1, a + 7]];
    let mut expected: Vec<[i16; 3]> = (0..20).flat_map(|k| quad(k / 5 * 6 + k % 5)).collect();
    expected.extend([[29, 3, 17], [100, 7, 101]]);
    // The encoder may begin a triangle with another corner.
    let from_least = |mut triangle: [i16; 3]| {
        let least = (0..3).min_by_key(|&k| triangle[k]).expect("three corners");
        triangle.rotate_left(least);
        triangle
    };
    let found = shorts(&decoded).chunks_exact(3).map(|t| from_least([t[0], t[1], t[2]])).collect::<Vec<_>>();
    assert_eq!(found, expected.into_iter().map(from_least).collect::<Vec<_>>());
}

#[test]
fn indices_of_two_sequences_come_back() {
    let decoded = decode(&compression(Mode::Indices, Filter::None, 10, 4), &bytes(INDICES)).expect("valid");
    assert_eq!(bytemuck::pod_collect_to_vec::<u8, u32>(&decoded), [5, 4, 6, 1000, 7, 1001, 8, 70_000, 9, 2]);
}

#[test]
fn unit_vectors_come_back_within_a_unit() {
    for (stride, stream, expected) in [
        (
            4,
            "oAE/AAAA/lzHAT8AAACSJtwAAT8AAAD+BP4AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAB/AA==",
            "AAB/AEwAmn/ETK6BZrQAAA==",
        ),
        (
            8,
            "oAEfAAAAZ3EBPwAAAA4ZFAE/AAAA22RhATsAAAAIEQAAAR0AAAAEATsAAAD+/wAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAD/BwAA",
            "AAAAAP9/AADFTAAAlZn/f5fCykwNrgGAa2Y7swAAAAA=",
        ),
    ] {
        let decoded =
            decode(&compression(Mode::Attributes, Filter::Octahedral, 4, stride), &bytes(stream)).expect("valid");
        let expected = bytes(expected);
        let numbers = |b: &[u8]| if stride == 4 { b.iter().map(|&x| i16::from(x as i8)).collect() } else { shorts(b) };
        for (x, y) in numbers(&decoded).into_iter().zip(numbers(&expected)) {
            assert!((x - y).abs() <= 1, "{x} {y}");
        }
    }
}

#[test]
fn unit_quaternions_come_back_within_a_unit() {
    let stream = bytes(
        "oAE/AAAAoNqGAT8AAAAWGwYBPwAAAJ/0hgE/AAAAFwcEAT8AAACg2oYBPwAAABYbBgE5AAAABQAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAD/Dw==",
    );
    let decoded = decode(&compression(Mode::Attributes, Filter::Quaternion, 4, 8), &stream).expect("valid");
    let expected = [0, 0, 0, 32767, 16377, 16386, -16386, 16386, -3276, 22936, -3276, -22938, 26212, 0, -19662, 0];
    for (x, y) in shorts(&decoded).into_iter().zip(expected) {
        assert!((x - y).abs() <= 1, "{x} {y}");
    }
}

#[test]
fn floats_come_back_with_their_mantissa() {
    let stream = bytes("oAED8wAAdYgRzAE//wAAELeoOulwTAEGGAAAASP/AAAVOiHNxgAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAIADz");
    let decoded = decode(&compression(Mode::Attributes, Filter::Exponential, 8, 4), &stream).expect("valid");
    let expected = [1.0, 2.5, -3.25, 0.001_000_046_730_041_504, 1e6, -7.0, 0.0, 0.299_987_792_968_75];
    assert_eq!(bytemuck::pod_collect_to_vec::<u8, f32>(&decoded), expected.map(|x: f64| x as f32));
}

#[test]
fn damaged_streams_are_refused_or_decoded_and_never_a_panic() {
    let streams = [
        (compression(Mode::Attributes, Filter::None, 40, 12), bytes(ATTRIBUTES)),
        (compression(Mode::Triangles, Filter::None, 126, 2), bytes(TRIANGLES)),
        (compression(Mode::Indices, Filter::None, 10, 4), bytes(INDICES)),
    ];
    let mut random = fastrand::Rng::with_seed(7);
    for (compression, stream) in streams {
        for cut in 0..stream.len() {
            assert!(decode(&compression, &stream[..cut]).is_err(), "cut to {cut} bytes");
        }
        assert!(decode(&compression, &[&stream[..], &[0]].concat()).is_err(), "a byte too many");
        for _ in 0..2_000 {
            let mut damaged = stream.clone();
            damaged[random.usize(..stream.len())] = random.u8(..);
            if let Ok(decoded) = decode(&compression, &damaged) {
                assert_eq!(decoded.len() as u64, compression.count * compression.byte_stride);
            }
        }
    }
}

#[test]
fn layouts_that_the_extension_does_not_allow_are_named() {
    use {Filter as F, Mode as M};
    for (mode, filter, count, stride, told) in [
        (M::Attributes, F::None, 4, 6, "items of 6 bytes"),
        (M::Attributes, F::None, 4, 260, "items of 260 bytes"),
        (M::Attributes, F::Octahedral, 4, 12, "items of 12 bytes"),
        (M::Attributes, F::Quaternion, 4, 4, "items of 4 bytes"),
        (M::Triangles, F::None, 4, 2, "4 indices make no triangles"),
        (M::Indices, F::None, 4, 1, "items of 1 bytes"),
        (M::Indices, F::Exponential, 4, 4, "a filter of indices"),
        (M::Attributes, F::None, u64::MAX, 16, "cannot make the"),
    ] {
        let error = decode_layout(mode, filter, count, stride);
        assert!(error.contains(told), "{error}");
    }
    let error =
        compression(M::Attributes, F::None, 40, 12).decode(&bytes(ATTRIBUTES), 479, "/x").expect_err("other size");
    assert!(error.to_string().contains("in a view of 479"), "{error}");
}

fn decode_layout(mode: Mode, filter: Filter, count: u64, stride: u64) -> String {
    let expected = count.saturating_mul(stride);
    compression(mode, filter, count, stride).decode(&[0xa0; 64], expected, "/x").expect_err("refused").to_string()
}
