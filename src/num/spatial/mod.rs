//! Searching in space: bounding volume hierarchies, k-d trees, triangles against points and rays, connected sets, shortest paths.
//!
//! Everything here is exact: a tree only leaves out what cannot be the answer, so that its answers are those of a search of
//! all. Distances are squared, in squared units of the points.

mod aabb;
mod box_tree;
mod kd_tree;
mod shortest_paths;
mod triangle;
mod union_find;

pub use aabb::{Aabb, Ray};
pub use box_tree::BoxTree;
pub use kd_tree::KdTree;
pub use shortest_paths::ShortestPaths;
pub use triangle::{ClosestPoint, Crossing, closest_point_on_triangle, ray_crosses_triangle};
pub use union_find::{UnionFind, components, numbered_components};
