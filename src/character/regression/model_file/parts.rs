//! What a file of a trained skin is made of.

use super::super::super::SkinWeights;
use super::super::reduced::{MOST_PROTOTYPES, Prototype};
use super::super::training::Regressor;
use super::bytes::{Reader, Writer};
use super::{ModelFileError, NONE};

/// Bytes of a regressor's numbers.
const MAP: usize = 36 * 8;
/// Most joints, as in skeletons.
const MOST_JOINTS: usize = 1 << 16;

/// Names of joints, and the joints they hang on.
pub(super) fn read_joints(r: &mut Reader<'_>) -> Result<(Vec<String>, Vec<Option<u32>>), ModelFileError> {
    let count = r.count(8, &|| "the joints".to_owned())?;
    if count == 0 || count > MOST_JOINTS {
        let expected = format!("1 to {MOST_JOINTS}");
        let place = "the number of joints".to_owned();
        return Err(ModelFileError::Value { place, value: count.to_string(), expected });
    }
    let (mut joints, mut parents) = (Vec::with_capacity(count), Vec::with_capacity(count));
    for j in 0..count {
        let place = &|| format!("the name of joint {j}");
        let length = r.u32(place)? as usize;
        let name = std::str::from_utf8(r.take(length, place)?);
        let name = name.map_err(|e| ModelFileError::Value {
            place: place(),
            value: e.to_string(),
            expected: "UTF-8".to_owned(),
        })?;
        joints.push(name.to_owned());
        parents.push(read_parent(r, j, count)?);
    }
    Ok((joints, parents))
}

fn read_parent(r: &mut Reader<'_>, joint: usize, count: usize) -> Result<Option<u32>, ModelFileError> {
    let place = || format!("the parent of joint {joint}");
    match r.u32(&place)? {
        NONE => Ok(None),
        parent if (parent as usize) < count => Ok(Some(parent)),
        parent => {
            let expected = format!("0 to {}, or {NONE} for none", count - 1);
            Err(ModelFileError::Value { place: place(), value: parent.to_string(), expected })
        }
    }
}

/// Weights of the blended places.
pub(super) fn read_weights(r: &mut Reader<'_>, vertices: usize, joints: usize) -> Result<SkinWeights, ModelFileError> {
    let mut rows = Vec::with_capacity(vertices);
    for v in 0..vertices {
        let place = &|| format!("the weights of vertex {v}");
        let count = r.index(joints + 1, place)?;
        r.fits(u64::from(count), 12, place)?;
        let mut row = Vec::with_capacity(count as usize);
        for _ in 0..count {
            row.push((r.index(joints, place)?, r.f64(place)?));
        }
        rows.push(row);
    }
    Ok(SkinWeights::new(joints, rows)?)
}

pub(super) fn write_weights(w: &mut Writer, weights: &SkinWeights) {
    for row in weights.rows() {
        w.u32(row.len() as u32);
        for i in row {
            w.u32(i.joint);
            w.f64(i.weight);
        }
    }
}

/// A regressor for every triangle.
pub(super) fn read_regressors(
    r: &mut Reader<'_>,
    triangles: usize,
    joints: usize,
) -> Result<Vec<Regressor>, ModelFileError> {
    r.fits(triangles as u64, 8 + MAP, &|| "the triangles".to_owned())?;
    let regressor = |t: usize| {
        let place = &|| format!("the regressor of triangle {t}");
        Ok(Regressor { bone: r.index(joints, place)?, joint: r.index(joints, place)?, map: r.matrix(place)? })
    };
    (0..triangles).map(regressor).collect()
}

pub(super) fn write_regressors(w: &mut Writer, regressors: &[Regressor]) {
    for regressor in regressors {
        w.u32(regressor.bone);
        w.u32(regressor.joint);
        w.matrix(&regressor.map);
    }
}

/// Prototypes, and per triangle which of them, how much of each.
type Reducing = (Vec<Prototype>, Vec<Vec<(u32, f64)>>);

pub(super) fn read_reduced(r: &mut Reader<'_>, triangles: usize, joints: usize) -> Result<Reducing, ModelFileError> {
    let count = r.count(8, &|| "the prototypes".to_owned())?;
    let most = joints.saturating_mul(MOST_PROTOTYPES + 1);
    if count > most {
        let place = "the number of prototypes".to_owned();
        return Err(ModelFileError::Value { place, value: count.to_string(), expected: format!("0 to {most}") });
    }
    let prototype = |p: usize| {
        let place = &|| format!("prototype {p}");
        let (bone, joint) = (r.index(joints, place)?, r.u32(place)?);
        if joint == NONE {
            return Ok(Prototype { bone, regressor: None });
        }
        if joint as usize >= joints {
            let expected = format!("joint 0 to {}, or {NONE} for none", joints - 1);
            return Err(ModelFileError::Value { place: place(), value: joint.to_string(), expected });
        }
        Ok(Prototype { bone, regressor: Some(Regressor { bone, joint, map: r.matrix(place)? }) })
    };
    let prototypes: Vec<Prototype> = (0..count).map(prototype).collect::<Result<_, _>>()?;
    let mut made_of = Vec::with_capacity(triangles);
    for t in 0..triangles {
        let place = &|| format!("the prototypes of triangle {t}");
        let (first, shares) = (r.index(count, place)?, r.u32(place)?);
        let most = count - first as usize;
        if shares as usize > most {
            let expected = format!("0 to {most} of them");
            return Err(ModelFileError::Value { place: place(), value: shares.to_string(), expected });
        }
        r.fits(u64::from(shares), 8, place)?;
        let share = |p: u32| Ok((p, r.f64(place)?));
        made_of.push((first..first + shares).map(share).collect::<Result<Vec<_>, ModelFileError>>()?);
    }
    Ok((prototypes, made_of))
}

pub(super) fn write_reduced(w: &mut Writer, prototypes: &[Prototype], made_of: &[Vec<(u32, f64)>]) {
    w.u64(prototypes.len() as u64);
    for prototype in prototypes {
        w.u32(prototype.bone);
        w.u32(prototype.regressor.map_or(NONE, |r| r.joint));
        prototype.regressor.iter().for_each(|r| w.matrix(&r.map));
    }
    for shares in made_of {
        w.u32(shares.first().map_or(0, |s| s.0));
        w.u32(shares.len() as u32);
        for (_, share) in shares {
            w.f64(*share);
        }
    }
}
