//! Which maps may follow one another in a render stage.
//!
//! A lens is taken out first, in the clip's own pictures; then the clip is stabilized; its shape is changed last. Each map must
//! know of those before it: points are carried through the lens, importance through the virtual camera.

use super::graph::{Graph, Stage};
use super::kind::MapStep;
use super::port::PortType;
use super::problem::Problem;

/// The first fault of the maps that `stage` takes.
pub(super) fn check(graph: &Graph, stage: &Stage) -> Option<Problem> {
    let edges = stage.edges.iter().filter(|e| e.output.data == PortType::Warp);
    let maps: Vec<(usize, MapStep)> = edges.filter_map(|e| Some((e.from, graph.stages[e.from].kind.map?))).collect();
    let name = |at: usize| graph.stages[at].name.as_str();
    let problem = |message: String, help: &'static str| Some(Problem::new("warps", message).help(help));
    // Maps of clips for clips, maps of photos for photos.
    let clip = stage.edges.iter().any(|e| e.output.data == PortType::Frames);
    if let Some((at, _)) = maps.iter().find(|(_, step)| clip == (*step == MapStep::Photo)) {
        let message = format!("`{}` takes the map `{}`, which is of another kind of picture", stage.name, name(*at));
        return problem(message, "maps of video.* and lens.* stages are for clips, those of photo.* stages for photos");
    }
    // In the order of the steps, at most one map of each.
    if let Some(pair) = maps.windows(2).find(|pair| pair[0].1 >= pair[1].1) {
        let message = format!(
            "`{}` takes the map `{}` after `{}`, which cannot be composed",
            stage.name,
            name(pair[1].0),
            name(pair[0].0)
        );
        return problem(message, "order maps as lens.undistort, video.warp, video.retarget, at most one of each");
    }
    // All maps of one lens.
    let find = |wanted: MapStep| maps.iter().find(|(_, step)| *step == wanted).map(|(at, _)| *at);
    let (lens, steady, shape) = (find(MapStep::Lens), find(MapStep::Steady), find(MapStep::Shape));
    for at in [steady, shape].into_iter().flatten() {
        if carried_through(graph, at) != lens {
            let message = format!("`{}` and `{}` do not go through the same lens", stage.name, name(at));
            return problem(
                message,
                "give the map of lens.undistort to both the render stage and `lens` of video.track",
            );
        }
    }
    // The change of shape is planned for the stabilized clip.
    if let Some(shape) = shape
        && path_of(graph, shape) != steady.and_then(|at| path_of(graph, at))
    {
        let message = format!("`{}` is not planned behind what stabilizes `{}`", name(shape), stage.name);
        return problem(
            message,
            "give `path` of video.retarget the path that video.warp takes, and none where there is none",
        );
    }
    None
}

/// The stage whose virtual camera a map follows.
fn path_of(graph: &Graph, at: usize) -> Option<usize> {
    graph.stages[at].edges.iter().find(|e| e.port.data == PortType::Path).map(|e| e.from)
}

/// The stage whose map the points behind `at` were carried through.
fn carried_through(graph: &Graph, at: usize) -> Option<usize> {
    let of_points = |e: &&super::graph::Edge| !matches!(e.port.data, PortType::Frames | PortType::Importance);
    let mut edges = graph.stages[at].edges.iter().filter(of_points);
    edges.find_map(|e| match graph.stages[e.from].kind.map {
        Some(MapStep::Lens) => Some(e.from),
        _ => carried_through(graph, e.from),
    })
}
