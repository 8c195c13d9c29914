//! All integration tests, in one binary: each further binary would cost a link per edit.

mod motion;
