//! What a finished stream adds to the summary.

use std::path::PathBuf;

use super::sampling::Feed;
use super::shake::Strays;
use super::tiers::Tiers;
use crate::pipeline::summary::{SegmentSummary, ShakeSummary, Summary};
use plumbline_media::{Output, WriteReport};
use plumbline_video::motion::sfm::SfmVerdict;
use plumbline_video::motion::{SegmentVerdict, Tier};

/// Tells of a file. Frames and size are those of the first.
pub(super) fn tell_file(summary: &mut Summary, output: &Output, size: (usize, usize), written: WriteReport) {
    summary.outputs.push(PathBuf::from(output.path()));
    summary.encoder.get_or_insert(written.encoder);
    if summary.size.is_none() {
        summary.frames = written.frames;
        summary.size = Some((size.0 as u32, size.1 as u32));
    }
    for warning in written.warnings {
        if !summary.warnings.contains(&warning) {
            summary.warnings.push(warning);
        }
    }
}

/// Crop and mode of the path that a render stage followed.
pub(super) struct PathTold {
    mean_crop: f64,
    least_crop: f64,
    shake: Option<ShakeSummary>,
    segments: Vec<SegmentSummary>,
}

impl PathTold {
    pub(super) fn of(feed: &Feed<'_>, tiers: &Tiers) -> Self {
        // A frame turned inside a window of its own size is a trace larger than the window.
        let crop: Vec<f64> = feed.path.crop.iter().map(|c| c.min(1.0)).collect();
        let mean = |crop: &[f64]| crop.iter().sum::<f64>() / crop.len().max(1) as f64;
        let strays = feed.motion.map(|m| Strays::of(m, &feed.path.out_from_src));
        let segment = |s: &SegmentVerdict| SegmentSummary {
            frames: s.frames.start as u64..s.frames.end as u64,
            mode: tier_name(s.tier).to_owned(),
            reason: s.reason.clone(),
            crop: crop.get(s.frames.clone()).map(mean),
            shake: strays.as_ref().and_then(|strays| strays.over(s.frames.clone())),
        };
        Self {
            mean_crop: mean(&crop),
            shake: strays.as_ref().and_then(Strays::whole),
            least_crop: crop.iter().copied().fold(1.0, f64::min),
            segments: tiers.segments.iter().map(segment).collect(),
        }
    }

    pub(super) fn tell(self, summary: &mut Summary) {
        summary.crop = Some(self.mean_crop);
        summary.least_crop = Some(self.least_crop);
        summary.shake = self.shake;
        summary.segments.extend(self.segments);
    }
}

/// The word for a tier.
pub(super) fn tier_name(tier: Tier) -> &'static str {
    match tier {
        Tier::Untouched => "unchanged",
        Tier::Similarity => "similarity",
        Tier::Homography => "homography",
        Tier::Mesh => "mesh",
        Tier::Rotation => "rotation",
        Tier::Subspace => "subspace",
        Tier::ThreeD => "3d",
    }
}

/// What the cameras of a shot turned out to be.
pub(super) fn verdict_name(verdict: SfmVerdict) -> &'static str {
    match verdict {
        SfmVerdict::ThreeD => "3d",
        SfmVerdict::Planar => "planar",
        SfmVerdict::RotationOnly => "rotation",
        SfmVerdict::Zoom => "zoom",
        SfmVerdict::TooFewPoints => "few points",
        SfmVerdict::Failed => "no cameras",
    }
}
