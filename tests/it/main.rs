//! All integration tests, in one binary: each further binary would cost a link per edit.

mod allocations;
mod bad_input_cli;
mod cli;
mod companions;
mod energy;
mod fuzz;
mod house;
mod in_space;
mod layers;
mod media_bad_input;
mod media_roundtrip;
mod motion;
mod path;
mod pictures;
mod pipeline;
mod pipeline_laws;
mod pipeline_run;
mod render;
mod render_oracle;
mod render_sharpness;
mod sfm;
mod sparse;
mod stabilize;
mod support;
mod track;
mod warp;
