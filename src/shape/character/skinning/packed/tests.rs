use nalgebra::{Point3, Vector3};

use super::super::tests::{matrices, tube, turn};
use super::super::{Skinner, SkinningMethod};
use super::*;
use plumbline_num::run::Run;

/// Largest distance of packed from exact results, relative to the diagonal, for a model that stands and moves far from the origin.
fn farthest(method: SkinningMethod, scaled: bool, at: Vector3<f64>) -> f64 {
    let (mesh, skeleton, skin) = tube(5, 24, 100);
    let m = matrices(&skeleton, &skin, |p| {
        p.locals[0].translation += at;
        p.locals[0].rotation = turn([0.3, 0.2, 1.0], 2.5);
        p.locals[1].rotation = turn([1.0, 0.3, 0.0], 2.0);
        p.locals[3].rotation = turn([0.0, 0.3, 1.0], -1.0);
        if scaled {
            p.locals[2].scale = Vector3::new(1.4, 0.8, 1.0);
        }
    });
    let exact = Skinner::new(&mesh, None, &skeleton, &skin, method, &Run::default())
        .expect("fits")
        .positions(&m)
        .expect("fits");
    let packed = PackedSkin::new(&mesh, &skin).expect("four at most");
    let mut out = vec![[f32::NAN; 3]; packed.vertex_count()];
    let from = match method {
        SkinningMethod::LinearBlend => packed.linear_blend(&m, &mut out),
        _ => packed.dual_quaternion(&m, &mut out),
    };
    let from = from.expect("fits");
    let place = |x: &[f32; 3]| from + Vector3::from(x.map(f64::from));
    let apart = exact.iter().zip(&out).map(|(p, x)| (p - place(x)).norm());
    apart.fold(0.0, f64::max) / mesh.diagonal()
}

#[test]
fn single_precision_is_within_two_millionths_of_the_diagonal_at_any_position() {
    for method in [SkinningMethod::LinearBlend, SkinningMethod::DualQuaternion] {
        for scaled in [false, true] {
            for at in [Vector3::zeros(), Vector3::new(1e5, -3e5, 2e5)] {
                let error = farthest(method, scaled, at);
                assert!(error < 2e-6, "{method:?} {scaled} {error:e}");
            }
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[test]
fn the_avx2_kernels_agree_with_the_scalar_ones_to_the_last_vertex() {
    if !avx2::available() {
        eprintln!("skipped: this processor has no AVX2 or no FMA");
        return;
    }
    let mut random = fastrand::Rng::with_seed(7);
    for count in [0, 1, 2, 3, 37] {
        let mut number = || random.f32() * 2.0 - 1.0;
        let vertices: Vec<PackedVertex> = (0..count)
            .map(|i| PackedVertex {
                position: [number(), number(), number()],
                weights: [0.4, 0.3, 0.2, 0.1],
                joints: [i as u16 % 5, (i as u16 + 2) % 5, 4, 3],
            })
            .collect();
        let maps: Vec<Columns> = (0..5)
            .map(|_| std::array::from_fn(|k| if k % 4 == 3 { f32::from(u8::from(k == 15)) } else { number() }))
            .collect();
        let motions: Vec<Motion> = (0..5).map(|_| std::array::from_fn(|_| number())).collect();
        let mut results = [0, 1, 2, 3, 4, 5].map(|_| vec![[f32::NAN; 3]; count]);
        let [a, b, c, d, e, f] = &mut results;
        avx2::linear_blend(&vertices, &maps, a);
        plain::linear_blend(&vertices, &maps, b);
        avx2::dual_quaternion(&vertices, None, &motions, c);
        plain::dual_quaternion(&vertices, None, &motions, d);
        avx2::dual_quaternion(&vertices, Some(&maps), &motions, e);
        plain::dual_quaternion(&vertices, Some(&maps), &motions, f);
        for pair in results.chunks(2) {
            for (x, y) in pair[0].iter().zip(&pair[1]) {
                let size = x.iter().map(|c| c.abs()).fold(1.0, f32::max);
                assert!(x.iter().zip(y).all(|(x, y)| (x - y).abs() < 1e-4 * size), "{x:?} {y:?}");
            }
        }
    }
}

#[test]
fn motions_that_cancel_leave_their_vertex_unmoved() {
    let vertex = PackedVertex { position: [1.0, 2.0, 3.0], weights: [0.0; 4], joints: [0; 4] };
    let motion = [[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]];
    let mut out = [[0.0; 3]];
    match_kernel!(dual_quaternion(&[vertex], None, &motion, &mut out));
    assert_eq!(out[0], vertex.position);
}

#[test]
fn five_influences_and_mismatched_sizes_are_rejected() {
    let (mesh, _, skin) = tube(2, 6, 4);
    let packed = PackedSkin::new(&mesh, &skin).expect("four at most");
    let m = [Matrix4::identity(); 2];
    assert!(packed.linear_blend(&m[..1], &mut vec![[0.0; 3]; 30]).is_err());
    let message = packed.dual_quaternion(&m, &mut [[0.0; 3]; 7]).expect_err("seven").to_string();
    assert!(message.contains("7 slots for results do not fit a mesh of 30"), "{message}");
    let row = (0..5).map(|j| (j, 0.2)).collect::<Vec<_>>();
    let weights = super::super::super::SkinWeights::new(5, [row]).expect("sums to 1");
    let skin = Skin::new(weights, vec![Matrix4::identity(); 5]).expect("fits");
    let point = TriMesh::new(vec![Point3::origin()], vec![]).expect("valid");
    let message = PackedSkin::new(&point, &skin).expect_err("five").to_string();
    assert!(message.contains("vertex 0 has 5 influences (at most 4)"), "{message}");
}
