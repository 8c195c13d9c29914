//! Weights: computed, painted, limited.

use std::sync::Arc;

use super::super::document::{CharacterDocument, WeightSource};
use super::super::message::{BrushOp, Edit};
use super::skeleton::sagittal;
use super::{Around, Edited, joint, point, refused};
use crate::error::StudioError;
use crate::workspace::Step;
use plumbline_shape::character::edit::other_side;
use plumbline_shape::character::weights::{Brush, BrushStroke, WeightOptions};

/// As the options of the library allow.
const MAX_INFLUENCES: u32 = 64;
const MAX_SMOOTH: u32 = 1000;

pub(super) fn apply(document: &CharacterDocument, edit: Edit, around: &mut Around<'_>) -> Edited {
    match edit {
        Edit::ComputeWeights { method, influences, smooth } => {
            if smooth > MAX_SMOOTH {
                return Err(StudioError::request(format!("{smooth} iterations of smoothing (at most {MAX_SMOOTH})")));
            }
            let influences = checked(influences)?;
            let options = WeightOptions {
                method: method.into(),
                influences,
                smooth: smooth as usize,
                ..WeightOptions::default()
            };
            let weights = WeightSource::Computed(options);
            Ok(Step::new(CharacterDocument { weights, ..document.clone() }, "Compute weights"))
        }
        Edit::Influences { max } => {
            let influences = checked(max)?;
            let weights = around.weights(document)?.limited(influences).map_err(refused)?;
            let options = WeightOptions { influences, ..*document.weights.options() };
            let weights = WeightSource::Given(Arc::new(weights), options);
            Ok(Step::new(CharacterDocument { weights, ..document.clone() }, format!("At most {max} joints per vertex")))
        }
        Edit::Paint { joint, op, center, radius, strength, value, mirror } => {
            let brush = match op {
                BrushOp::Add => Brush::Add,
                BrushOp::Subtract => Brush::Subtract,
                BrushOp::Smooth => Brush::Smooth,
                BrushOp::Replace => Brush::Replace(value),
            };
            let influences = document.weights.options().influences;
            let strength = strength.min(1.0);
            let stroke = BrushStroke { joint, brush, center: point(center)?, radius, strength, influences };
            paint(document, &stroke, mirror, around)
        }
        other => Err(StudioError::request(format!("this edit is not possible: {other:?}"))),
    }
}

fn checked(influences: u32) -> Result<usize, StudioError> {
    if (1..=MAX_INFLUENCES).contains(&influences) {
        Ok(influences as usize)
    } else {
        Err(StudioError::request(format!("{influences} joints per vertex (expected 1 to {MAX_INFLUENCES})")))
    }
}

fn paint(document: &CharacterDocument, stroke: &BrushStroke, mirror: bool, around: &Around<'_>) -> Edited {
    let (skeleton, weights) = (around.skeleton(document)?, around.weights(document)?);
    let name = &joint(&skeleton, stroke.joint)?.name;
    let mut painted = weights.painted(around.mesh, around.neighbors, stroke).map_err(refused)?;
    if mirror {
        let plane = sagittal(around);
        let across = (stroke.center - plane.point).dot(&plane.normal);
        let center = stroke.center - plane.normal.into_inner() * (2.0 * across);
        let joint = other_side(name).and_then(|other| skeleton.find(&other)).unwrap_or(stroke.joint);
        let image = BrushStroke { center, joint, ..*stroke };
        painted = painted.painted(around.mesh, around.neighbors, &image).map_err(refused)?;
    }
    let weights = WeightSource::Given(Arc::new(painted), *document.weights.options());
    let step = Step::new(CharacterDocument { weights, ..document.clone() }, format!("Paint weights of {name}"));
    Ok(step.merged(format!("paint {}", stroke.joint)))
}
