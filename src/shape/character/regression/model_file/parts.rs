//! Sections of a trained skin file.

use nalgebra::DMatrix;

use super::super::super::SkinWeights;
use super::super::reduced::{Group, MAX_KEYS, Map};
use super::super::training::Regressor;
use super::NONE;
use super::bytes::{Reader, Writer, invalid};
use crate::character::RigFileError;

/// Bytes of a regressor's matrix.
const MAP: usize = 36 * 8;
/// Largest number of joints, as in skeletons.
const MAX_JOINTS: usize = 1 << 16;

/// Joint names and parents.
pub(super) fn read_joints(r: &mut Reader<'_>) -> Result<(Vec<String>, Vec<Option<u32>>), RigFileError> {
    let count = r.count(8, &|| "the joints".to_owned())?;
    if count == 0 || count > MAX_JOINTS {
        return Err(invalid("the number of joints", count, &format!("1 to {MAX_JOINTS}")));
    }
    let (mut joints, mut parents) = (Vec::with_capacity(count), Vec::with_capacity(count));
    for j in 0..count {
        let item = &|| format!("the name of joint {j}");
        let length = r.u32(item)? as usize;
        let name = std::str::from_utf8(r.take(length, item)?);
        joints.push(name.map_err(|e| invalid(&item(), e, "UTF-8"))?.to_owned());
        parents.push(read_parent(r, j, count)?);
    }
    Ok((joints, parents))
}

fn read_parent(r: &mut Reader<'_>, joint: usize, count: usize) -> Result<Option<u32>, RigFileError> {
    let item = || format!("the parent of joint {joint}");
    match r.u32(&item)? {
        NONE => Ok(None),
        parent if (parent as usize) < count => Ok(Some(parent)),
        parent => Err(invalid(&item(), parent, &format!("0 to {}, or {NONE} for none", count - 1))),
    }
}

/// Weights of the blended positions.
pub(super) fn read_weights(r: &mut Reader<'_>, vertices: usize, joints: usize) -> Result<SkinWeights, RigFileError> {
    let mut rows = Vec::with_capacity(vertices);
    for v in 0..vertices {
        let item = &|| format!("the weights of vertex {v}");
        let count = r.index(joints + 1, item)?;
        r.fits(u64::from(count), 12, item)?;
        let mut row = Vec::with_capacity(count as usize);
        for _ in 0..count {
            row.push((r.index(joints, item)?, r.f64(item)?));
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

/// One regressor per triangle.
pub(super) fn read_regressors(
    r: &mut Reader<'_>,
    triangles: usize,
    joints: usize,
) -> Result<Vec<Regressor>, RigFileError> {
    r.fits(triangles as u64, 8 + MAP, &|| "the triangles".to_owned())?;
    let regressor = |t: usize| {
        let item = &|| format!("the regressor of triangle {t}");
        Ok(Regressor { bone: r.index(joints, item)?, joint: r.index(joints, item)?, map: r.matrix(item)? })
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

/// Groups, the group of each triangle, and all maps.
pub(super) type Reducing = (Vec<Group>, Vec<u32>, Vec<Map>);

pub(super) fn read_reduced(r: &mut Reader<'_>, triangles: usize, joints: usize) -> Result<Reducing, RigFileError> {
    let count = r.count(16, &|| "the groups".to_owned())?;
    let groups: Vec<Group> = (0..count).map(|s| read_group(r, s, joints)).collect::<Result<_, _>>()?;
    let (mut group_of, mut maps) = (Vec::with_capacity(triangles), Vec::new());
    for t in 0..triangles {
        let item = &|| format!("the maps of triangle {t}");
        let sheet = r.index(count, item)?;
        group_of.push(sheet);
        let each = 1 + groups[sheet as usize].shape_count();
        r.fits(each as u64, 4 * 9, item)?;
        for _ in 0..each {
            let mut map = [0.0; 9];
            for x in &mut map {
                *x = r.f32(item)?;
            }
            maps.push(map);
        }
    }
    Ok((groups, group_of, maps))
}

fn read_group(r: &mut Reader<'_>, sheet: usize, joints: usize) -> Result<Group, RigFileError> {
    let item = &|| format!("group {sheet}");
    let (bone, joint) = (r.index(joints, item)?, r.index(joints, item)?);
    let keys = r.index(MAX_KEYS + 1, &|| format!("the number of key triangles of group {sheet}"))? as usize;
    let shapes = r.index(9 * keys + 1, &|| format!("the number of shapes of group {sheet}"))? as usize;
    let keys = (0..keys).map(|_| r.matrix(item)).collect::<Result<Vec<_>, _>>()?;
    r.fits((shapes * 9 * keys.len()) as u64, 8, item)?;
    let mut reading = DMatrix::zeros(shapes, 9 * keys.len());
    for x in reading.iter_mut() {
        *x = r.f64(item)?;
    }
    Ok(Group { bone, joint, keys, reading })
}

pub(super) fn write_reduced(w: &mut Writer, (groups, group_of, maps): &Reducing) {
    w.u64(groups.len() as u64);
    for sheet in groups {
        w.u32(sheet.bone);
        w.u32(sheet.joint);
        w.u32(sheet.keys.len() as u32);
        w.u32(sheet.shape_count() as u32);
        sheet.keys.iter().for_each(|map| w.matrix(map));
        sheet.reading.iter().for_each(|x| w.f64(*x));
    }
    let mut maps = maps.iter();
    for &sheet in group_of {
        w.u32(sheet);
        for map in maps.by_ref().take(1 + groups[sheet as usize].shape_count()) {
            for x in map {
                w.f32(*x);
            }
        }
    }
}
