//! Messages between the page and the workspace.

use serde::{Deserialize, Serialize};

/// Kinds of buffers. Positions are px of the source or of the result, little-endian.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[repr(u32)]
pub enum BufferKind {
    /// The source as a JPEG file, perhaps smaller than the photo.
    Source = 300,
    /// A part of the source in detail: as `Result`.
    SourcePart = 301,
    /// The result or a part of it: four `f32`, left, top, right and bottom, px of the result at full size; width and height of
    /// the samples, `u32`; then red, green and blue, a byte each.
    Result = 302,
    /// The grid of the map, px of the result: columns and rows of vertices, `u32`, then two `f32` per vertex.
    Grid = 303,
    /// Marked lines, px of the source: number of lines, `u32`, number of points of each, `u32`, padding to 8 bytes, then two `f64`
    /// per point.
    Marks = 304,
    /// The courses of marked lines, px of the source: number of lines, `u32`, number of points of each, `u32`, then two `f32` per
    /// point. Between two marks a line runs as the lens shows a straight edge.
    Courses = 305,
    /// The courses of found lines, as `Courses`.
    FoundCourses = 306,
    /// Marked lines as the result shows them, px of the result, as `Courses`.
    Carried = 307,
    /// Found lines that are in use, as the result shows them, as `Courses`.
    FoundCarried = 308,
}

/// A change of the document.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(optional_fields))]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub enum Edit {
    /// A line along the image of a straight edge, points in order, px. Found lines that are in use are adopted with the first one.
    AddLine {
        /// Two or more.
        points: Vec<[f64; 2]>,
        /// Default: free.
        orientation: Option<OrientationSetting>,
    },
    /// A point of a line to a position; in a row one step.
    MovePoint {
        /// Its line.
        line: usize,
        /// Its number.
        point: usize,
        /// px.
        x: f64,
        /// px.
        y: f64,
    },
    /// All points of a line, px; in a row one step.
    SetPoints {
        /// The line.
        line: usize,
        /// Two or more.
        points: Vec<[f64; 2]>,
    },
    /// A further point before point `at` of a line.
    InsertPoint {
        /// The line.
        line: usize,
        /// Its number.
        at: usize,
        /// px.
        x: f64,
        /// px.
        y: f64,
    },
    /// Takes a point of a line of three or more away.
    RemovePoint {
        /// The line.
        line: usize,
        /// Its number.
        point: usize,
    },
    /// Takes lines away.
    DeleteLines {
        /// Their numbers.
        lines: Vec<usize>,
    },
    /// Another orientation of lines.
    Orient {
        /// Their numbers.
        lines: Vec<usize>,
        /// How they shall lie.
        orientation: OrientationSetting,
    },
    /// Another name of a line.
    RenameLine {
        /// The line.
        line: usize,
        /// Its name.
        name: String,
    },
    /// Switches lines off or on.
    SwitchLines {
        /// Their numbers.
        lines: Vec<usize>,
        /// Kept and not used.
        off: bool,
    },
    /// Moves the points of a line to the strongest edge near them.
    SnapLine {
        /// The line.
        line: usize,
    },
    /// Found lines become marked ones.
    Adopt {
        /// Their names.
        names: Vec<String>,
    },
    /// Switches found lines off or on.
    SwitchFound {
        /// Their names.
        names: Vec<String>,
        /// Not used.
        off: bool,
    },
    /// Another lens.
    SetLens {
        /// `auto`, a file, or a model.
        lens: String,
        /// Field of view, degrees.
        fov: Option<f64>,
        /// Its direction: `h`, `v` or `d`.
        fov_axis: Option<String>,
    },
    /// A setting of `photo.rectify`, `image.render` or `image.save`; an empty text leaves it to the default. In a row one step.
    Set {
        /// `to`, `crop`, `view`, `view_field`, `size`, `border`, `interpolation`, `path`, `quality`.
        key: String,
        /// As in the file.
        value: String,
    },
    /// A face that was not found.
    AddFace {
        /// Left, top, width, height, px.
        rect: [f64; 4],
    },
    /// Another box of a face; in a row one step.
    SetFace {
        /// The face.
        face: usize,
        /// Left, top, width, height, px.
        rect: [f64; 4],
    },
    /// Another name of a face.
    RenameFace {
        /// The face.
        face: usize,
        /// Its name.
        name: String,
    },
    /// Switches faces off or on.
    SwitchFaces {
        /// Their numbers.
        faces: Vec<usize>,
        /// Kept and not used.
        off: bool,
    },
    /// Takes faces away.
    DeleteFaces {
        /// Their numbers.
        faces: Vec<usize>,
    },
    /// Forgets corrections: faces are those that are found.
    FindFaces,
    /// Selects.
    Select {
        /// Lines.
        #[serde(default)]
        lines: Vec<usize>,
        /// A point of the last line.
        #[serde(default)]
        point: Option<usize>,
        /// Faces.
        #[serde(default)]
        faces: Vec<usize>,
    },
}

/// How a line shall lie in the result: `"free"`, `"horizontal"`, `"vertical"`, or degrees from +x towards +y (down).
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(untagged)]
pub enum OrientationSetting {
    /// By name.
    Word(String),
    /// Degrees.
    Degrees(f64),
}

/// What a window looks at. Fields that are left out stay.
#[derive(Clone, Debug, Default, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(optional_fields))]
#[serde(default, deny_unknown_fields)]
pub struct View {
    /// Pixels of the screen that the result has, width and height.
    pub size: Option<[u32; 2]>,
    /// Part of the result that is seen: left, top, right and bottom as fractions of its sides.
    pub part: Option<[f64; 4]>,
    /// The same of the source.
    pub source_part: Option<[f64; 4]>,
    /// The grid of the map is shown.
    pub grid: Option<bool>,
}

/// A question.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(tag = "ask", rename_all = "snake_case", deny_unknown_fields)]
pub enum Ask {
    /// The picture at full size, as the pipeline writes it.
    Export,
    /// The command that makes it.
    Command,
    /// Files of the folder that may be lens files.
    LensFiles,
}

/// What the page shows.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct State {
    /// The photo.
    pub photo: PhotoInfo,
    /// Settings as in the pipeline.
    pub settings: SettingsInfo,
    /// The lens that is in use.
    pub lens: Option<LensInfo>,
    /// Why there is no result.
    pub problem: Option<String>,
    /// Marked lines.
    pub lines: Vec<LineInfo>,
    /// Found lines; `None` while they are searched.
    pub found: Option<Vec<FoundInfo>>,
    /// Which lines the result is made with: `marked`, `found` or `none`.
    pub using: &'static str,
    /// Faces; `None` while they are searched.
    pub faces: Option<Vec<FaceInfo>>,
    /// Faces were corrected by hand.
    pub faces_marked: bool,
    /// The selection.
    pub selected: Selected,
    /// The result.
    pub result: Option<ResultInfo>,
}

/// The photo.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct PhotoInfo {
    /// Name of its file.
    pub name: String,
    /// px.
    pub width: usize,
    /// px.
    pub height: usize,
    /// What EXIF says of camera and lens, as name and value.
    pub exif: Vec<(String, String)>,
    /// Large: details are shown from a smaller copy.
    pub reduced: bool,
}

/// Settings as they are written in the pipeline.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct SettingsInfo {
    /// Projection.
    pub to: String,
    /// Lens: `auto`, a file, a model.
    pub lens: String,
    /// Field of view of the lens, degrees.
    pub fov: Option<f64>,
    /// `h`, `v` or `d`.
    pub fov_axis: String,
    /// View direction, degrees: yaw, pitch, roll.
    pub view: [f64; 3],
    /// Field of view of the result: `WIDTH,HEIGHT`, degrees; empty: all.
    pub view_field: String,
    /// Crop.
    pub crop: String,
    /// Size; empty: as wide as the photo.
    pub size: String,
    /// Border.
    pub border: String,
    /// Kernel.
    pub interpolation: String,
    /// The file that is written.
    pub path: String,
    /// JPEG quality.
    pub quality: u8,
}

/// A lens.
#[derive(Clone, Debug, Serialize, PartialEq)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct LensInfo {
    /// Where it comes from, in words.
    pub how: String,
    /// Its projection.
    pub projection: String,
    /// Focal lengths, px.
    pub focal_px: [f64; 2],
    /// Its center, px.
    pub center_px: [f64; 2],
    /// Fields of view, degrees: horizontal, vertical, diagonal.
    pub field_deg: [Option<f64>; 3],
}

/// A marked line. Its points are a buffer.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct LineInfo {
    /// Its name.
    pub name: String,
    /// How it shall lie.
    pub orientation: OrientationSetting,
    /// Not used.
    pub off: bool,
    /// Number of its points.
    pub points: usize,
    /// How straight it became.
    pub report: Option<Straightness>,
}

/// How straight a line became.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Straightness {
    /// Largest distance from the best straight line, px of the result.
    pub max_px: f64,
    /// Root mean square distance, px of the result.
    pub rms_px: f64,
    /// Difference to the wanted orientation, degrees.
    pub angle_error_deg: Option<f64>,
    /// Largest distance of a mark from what the lens makes of a straight edge, px of the source.
    pub off_lens_px: Option<f64>,
    /// Fraction of it that the result shows.
    pub shown: f64,
    /// It could not be made straight.
    pub bent: bool,
}

/// A found line.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct FoundInfo {
    /// Its name.
    pub name: String,
    /// How it shall lie.
    pub orientation: OrientationSetting,
    /// Switched off.
    pub off: bool,
    /// Length between its ends, px.
    pub length: f64,
}

/// A face.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct FaceInfo {
    /// Its name.
    pub name: String,
    /// Left, top, width, height, px.
    pub rect: [f64; 4],
    /// Not used.
    pub off: bool,
    /// The crop does not show all of it.
    pub cut: bool,
}

/// The selection.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Selected {
    /// Lines.
    pub lines: Vec<usize>,
    /// A point of the last line.
    pub point: Option<usize>,
    /// Faces.
    pub faces: Vec<usize>,
}

/// The result.
#[derive(Clone, Copy, Debug, Serialize, PartialEq)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct ResultInfo {
    /// px.
    pub width: usize,
    /// px.
    pub height: usize,
    /// As the pipeline makes it, not the quick one of a drag.
    pub exact: bool,
}
