//! What posing has from other files: the motion of another character, and how long a movement takes.

use std::path::Path;

use super::prelude::*;
use plumbline_num::run::Run;
use plumbline_shape::character::io::read_rig;
use plumbline_shape::character::retargeting::{
    Correspondence, FootReport, JointMap, MatchedBy, RetargetingOptions, RetargetingReport, retarget,
};
use plumbline_shape::character::{Character, CharacterError, Clip, Joint, Skeleton};
use plumbline_shape::mesh::ReadLimits;

/// Distance from a target above which it is reported: a thousandth of the model's diagonal, a pixel where the model fills a picture; of
/// orientations and directions, rad, the same displacement at the distance of the diagonal.
pub(super) const MISSED: f64 = 1e-3;

/// The clips of another skeleton, carried to this one.
pub(super) fn retargeted(
    context: &mut Context<'_, '_>,
    character: &Character,
    path: &Path,
    map: Option<&Path>,
    clip: Option<&str>,
) -> Result<Vec<Clip>, RunError> {
    let about = |e: CharacterError| RunError::from(e).about(path.display());
    let source = read_rig(path, &context.job.read_limits(), &context.job.run());
    let source = source.map_err(|e| RunError::Input(e.to_string()))?;
    source.warnings.iter().for_each(|w| context.warn(format!("{}: {w}", path.display())));
    let map = match map {
        None => JointMap::default(),
        Some(file) => JointMap::read(file, &source.skeleton, &character.skeleton)
            .map_err(|e| RunError::Input(e.to_string()).about(file.display()))?,
    };
    let map = Correspondence::find(&source.skeleton, &character.skeleton, &map, &context.job.run()).map_err(about)?;
    if let MatchedBy::Shape { ambiguous } = map.by {
        let doubt = if ambiguous { "; left and right, or front and back, fit equally well" } else { "" };
        let pairs = paired(&map, &source.skeleton, &character.skeleton);
        context.warn(format!(
            "{}: joints are matched by the shape of the limbs, names do not say{doubt}: {pairs}",
            path.display()
        ));
    }
    let clips: Vec<&Clip> = match clip {
        Some(name) => vec![source.clip(name).map_err(about)?],
        None if source.clips.is_empty() => {
            return Err(RunError::Input("it has no movement".to_owned()).about(path.display()));
        }
        None => source.clips.iter().collect(),
    };
    let mut carried = Vec::new();
    for clip in clips {
        let (clip, report) = retarget(
            &source.skeleton,
            clip,
            &character.skeleton,
            &map,
            &RetargetingOptions::default(),
            &context.job.run(),
        )
        .map_err(about)?;
        report_retargeting(context, clip.name(), &source.skeleton, character, &report);
        carried.push(clip);
    }
    Ok(carried)
}

/// Pairs of joints, as a message lists them.
fn paired(map: &Correspondence, source: &Skeleton, target: &Skeleton) -> String {
    let pair = |(i, joint): (&Option<u32>, &Joint)| {
        Some(format!("{} follows {}", joint.name, source.joints()[(*i)? as usize].name))
    };
    let pairs: Vec<String> = map.source_of.iter().zip(target.joints()).filter_map(pair).collect();
    listed(&pairs)
}

/// The first of some names, and how many more there are.
fn listed(names: &[String]) -> String {
    const SHOWN: usize = 24;
    let more = names.len().saturating_sub(SHOWN);
    let shown = names.iter().take(SHOWN).cloned().collect::<Vec<_>>().join(", ");
    if more > 0 { format!("{shown} and {more} more") } else { shown }
}

/// A line of the summary, and warnings of what did not carry over.
fn report_retargeting(
    context: &mut Context<'_, '_>,
    clip: &str,
    source: &Skeleton,
    character: &Character,
    report: &RetargetingReport,
) {
    let largest = |of: fn(&FootReport) -> f64| report.feet.iter().map(of).fold(0.0, f64::max);
    let contacts: usize = report.feet.iter().map(|foot| foot.contacts).sum();
    let mut line = format!(
        "{clip}: {} of {} joints follow, {:.4} times as large; {contacts} contacts of {} feet",
        report.followed,
        character.skeleton.joint_count(),
        report.scale,
        report.feet.len()
    );
    if contacts > 0 {
        let [held, free, source] =
            [largest(|f| f.slide), largest(|f| f.free_slide), largest(|f| f.source_slide)].map(|x| 100.0 * x);
        let feet = format!(
            ", which slide by {held:.2} % of the leg at most ({free:.2} % unheld, {source:.2} % in the source)"
        );
        line.push_str(&feet);
    }
    if let Some(surface) = &mut context.summary.surface {
        surface.retargeted.push(line);
    }
    if !report.left_out.is_empty() {
        let names: Vec<String> = report.left_out.iter().map(|j| source.joints()[*j as usize].name.clone()).collect();
        context.warn(format!("{clip}: no joint follows {}", listed(&names)));
    }
    if report.missed > MISSED {
        context.warn(format!("{clip}: a foot on the ground is missed by {:.1} % of the leg", 100.0 * report.missed));
    }
    if report.limited > MISSED {
        context.warn(format!(
            "{clip}: the limits of the character change rotations by up to {:.1}°",
            report.limited.to_degrees()
        ));
    }
}

/// The clip that is shown: the only one that was carried over.
pub(super) fn only(carried: &[Clip], rig: bool) -> Result<Option<String>, RunError> {
    match carried {
        [clip] => Ok(Some(clip.name().to_owned())),
        _ if rig => Ok(None),
        _ => {
            let known: Vec<String> = carried.iter().map(|c| format!("{:?}", c.name())).collect();
            Err(RunError::Usage(format!("`clip` names one of the movements {} to write", known.join(", "))))
        }
    }
}

/// Begin and end of a movement of a file, s; of its only movement where none is named.
///
/// # Errors
/// [`RunError::Input`] for a file that cannot be read or does not have the movement; [`RunError::Usage`] where one has to be named.
pub(crate) fn clip_span(path: &Path, clip: Option<&str>) -> Result<(f64, f64), RunError> {
    let rig = read_rig(path, &ReadLimits::default(), &Run::default()).map_err(|e| RunError::Input(e.to_string()))?;
    let name = match clip {
        Some(name) => name.to_owned(),
        None => only(&rig.clips, false)?.unwrap_or_default(),
    };
    let found = rig.clip(&name).map_err(|e| RunError::from(e).about(path.display()))?;
    Ok(found.span().unwrap_or((0.0, 0.0)))
}
