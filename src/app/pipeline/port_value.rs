//! Values at ports: the Rust types behind the port types.
//!
//! A kind declares its ports, with names and docs, and says as types what its `run` takes and gives. Both are compared where
//! the kind is registered ([`super::kind::StageKind::of`]), at compile time: a kind whose `run` does not fit its ports does not
//! compile.

use std::any::Any;

use super::graph::Edge;
use super::kind::TemporalScope;
use super::port::{Arity, Port, PortType};
use super::run_error::RunError;
use crate::stages::context::Context;

/// What one stage hands to others: cheap to clone, since every stage that takes it gets its own.
pub trait PortValue: Any + Clone + Send {
    /// The type of the ports that carry it.
    const DATA: PortType;

    /// The value at the other end of `edge`: of this type, unless a value of another one can be had as this.
    ///
    /// # Errors
    /// [`RunError::Internal`] where nothing, or a value of another type, was handed on.
    fn at(context: &Context<'_, '_>, edge: &Edge) -> Result<Self, RunError> {
        context.values.get::<Self>(edge).cloned()
    }
}

/// What an input port gives to `run`: a value where it must be connected, an `Option` where it may be left open, a `Vec` where
/// it takes a list.
pub trait InputValue: Sized {
    /// The ports that it fits.
    const FITS: InputType;

    /// The value at `port` of stage number `stage`.
    ///
    /// # Errors
    /// [`RunError::Internal`] where nothing, or a value of another type, was handed on.
    fn take(context: &Context<'_, '_>, stage: usize, port: &Port) -> Result<Self, RunError>;
}

/// What `run` gives to an output port.
pub trait OutputValue: Sized {
    /// The type of the port.
    const DATA: PortType;

    /// Hands it to the stages that are connected to the port.
    fn put(self, context: &mut Context<'_, '_>, stage: usize, port: &Port);
}

/// Everything that `run` takes: a tuple in the order of the ports, or [`Wired`].
pub trait Inputs: Sized {
    /// The ports that it fits; `None`: any.
    const FITS: Option<&'static [InputType]>;
    /// How the result of a stage with these inputs depends on time, unless the stage says otherwise.
    const OVER_TIME: TemporalScope;

    /// The values at `ports` of stage number `stage`.
    ///
    /// # Errors
    /// [`RunError::Internal`] where nothing, or a value of another type, was handed on.
    fn take(context: &Context<'_, '_>, stage: usize, ports: &'static [Port]) -> Result<Self, RunError>;
}

/// Everything that `run` gives: a tuple in the order of the ports, or [`HandedOn`].
pub trait Outputs: Sized {
    /// The types of the ports that it fits; `None`: any.
    const FITS: Option<&'static [PortType]>;

    /// Hands each value to the stages that are connected to its port.
    fn put(self, context: &mut Context<'_, '_>, stage: usize, ports: &'static [Port]);
}

/// The ports that a type of inputs fits.
#[derive(Clone, Copy, Debug)]
pub struct InputType {
    /// What they carry.
    pub data: PortType,
    /// How many edges they take.
    pub arities: &'static [Arity],
}

/// Inputs of a stage over a clip: frames are streamed, and results of earlier passes are looked up while it runs.
#[derive(Clone, Copy, Debug)]
pub struct Wired {
    /// The number of the stage in the graph.
    pub stage: usize,
}

/// Outputs of a stage over a clip, which were handed on while it ran, or which are streams.
#[derive(Clone, Copy, Debug)]
pub struct HandedOn;

/// A file was written, if one was asked for.
#[derive(Clone, Copy, Debug)]
pub struct Written;

impl<T: PortValue> InputValue for T {
    const FITS: InputType = InputType { data: T::DATA, arities: &[Arity::One] };

    fn take(context: &Context<'_, '_>, stage: usize, port: &Port) -> Result<Self, RunError> {
        T::at(context, context.required(stage, port.name)?)
    }
}

impl<T: PortValue> InputValue for Option<T> {
    const FITS: InputType = InputType { data: T::DATA, arities: &[Arity::Optional] };

    fn take(context: &Context<'_, '_>, stage: usize, port: &Port) -> Result<Self, RunError> {
        context.edge(stage, port.name).map(|edge| T::at(context, edge)).transpose()
    }
}

impl<T: PortValue> InputValue for Vec<T> {
    const FITS: InputType = InputType { data: T::DATA, arities: &[Arity::Many, Arity::Any] };

    fn take(context: &Context<'_, '_>, stage: usize, port: &Port) -> Result<Self, RunError> {
        let edges = context.stage(stage).edges.iter().filter(|e| e.port.name == port.name);
        edges.map(|edge| T::at(context, edge)).collect()
    }
}

impl<T: PortValue> OutputValue for T {
    const DATA: PortType = T::DATA;

    fn put(self, context: &mut Context<'_, '_>, stage: usize, port: &Port) {
        context.values.put(stage, port.name, self);
    }
}

impl OutputValue for Written {
    const DATA: PortType = PortType::File;

    fn put(self, _context: &mut Context<'_, '_>, _stage: usize, _port: &Port) {}
}

impl Inputs for Wired {
    const FITS: Option<&'static [InputType]> = None;
    const OVER_TIME: TemporalScope = TemporalScope::Map;

    fn take(_context: &Context<'_, '_>, stage: usize, _ports: &'static [Port]) -> Result<Self, RunError> {
        Ok(Self { stage })
    }
}

impl Outputs for HandedOn {
    const FITS: Option<&'static [PortType]> = None;

    fn put(self, _context: &mut Context<'_, '_>, _stage: usize, _ports: &'static [Port]) {}
}

/// Tuples of inputs and of outputs.
macro_rules! tuples {
    ($($($name:ident $index:tt)*;)*) => {$(
        impl<$($name: InputValue),*> Inputs for ($($name,)*) {
            const FITS: Option<&'static [InputType]> = Some(&[$($name::FITS),*]);
            const OVER_TIME: TemporalScope = TemporalScope::Once;

            #[allow(unused_variables, clippy::unused_unit)] // of no input
            fn take(context: &Context<'_, '_>, stage: usize, ports: &'static [Port]) -> Result<Self, RunError> {
                Ok(($($name::take(context, stage, &ports[$index])?,)*))
            }
        }

        impl<$($name: OutputValue),*> Outputs for ($($name,)*) {
            const FITS: Option<&'static [PortType]> = Some(&[$($name::DATA),*]);

            #[allow(unused_variables)] // of no output
            fn put(self, context: &mut Context<'_, '_>, stage: usize, ports: &'static [Port]) {
                $(self.$index.put(context, stage, &ports[$index]);)*
            }
        }
    )*};
}

tuples! {
    ;
    A 0;
    A 0 B 1;
    A 0 B 1 C 2;
    A 0 B 1 C 2 D 3;
}

/// Whether declared input ports are those that a `run` takes.
pub(super) const fn inputs_fit(ports: &[Port], types: Option<&[InputType]>) -> bool {
    let Some(types) = types else { return true };
    if ports.len() != types.len() {
        return false;
    }
    // Constant evaluation knows no iterators and no `==` of enums.
    let mut i = 0;
    while i < ports.len() {
        if ports[i].data as u8 != types[i].data as u8 || !is_among(ports[i].arity, types[i].arities) {
            return false;
        }
        i += 1;
    }
    true
}

const fn is_among(arity: Arity, arities: &[Arity]) -> bool {
    let mut i = 0;
    while i < arities.len() {
        if arity as u8 == arities[i] as u8 {
            return true;
        }
        i += 1;
    }
    false
}

/// Whether declared output ports are those that a `run` gives.
pub(super) const fn outputs_fit(ports: &[Port], types: Option<&[PortType]>) -> bool {
    let Some(types) = types else { return true };
    if ports.len() != types.len() {
        return false;
    }
    let mut i = 0;
    while i < ports.len() {
        if ports[i].data as u8 != types[i] as u8 {
            return false;
        }
        i += 1;
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone)]
    struct Surface;

    impl PortValue for Surface {
        const DATA: PortType = PortType::Mesh;
    }

    #[test]
    fn what_run_takes_must_be_what_the_ports_carry_as_often_as_they_carry_it() {
        let one = Port::one("mesh", PortType::Mesh, "");
        let open = Port::optional("mesh", PortType::Mesh, "");
        let list = Port::many("mesh", PortType::Mesh, "");
        let picture = Port::one("image", PortType::Image, "");
        assert!(inputs_fit(&[one], <(Surface,) as Inputs>::FITS));
        assert!(inputs_fit(&[one, open], <(Surface, Option<Surface>) as Inputs>::FITS));
        assert!(inputs_fit(&[list], <(Vec<Surface>,) as Inputs>::FITS));
        assert!(inputs_fit(&[picture, list], Wired::FITS) && outputs_fit(&[picture], HandedOn::FITS));
        for wrong in [&[open][..], &[list], &[picture], &[one, one], &[]] {
            assert!(!inputs_fit(wrong, <(Surface,) as Inputs>::FITS), "{wrong:?}");
        }
        assert!(!inputs_fit(&[one], <(Vec<Surface>,) as Inputs>::FITS));
        let file = Port::one("file", PortType::File, "");
        assert!(outputs_fit(&[one, file], <(Surface, Written) as Outputs>::FITS));
        for wrong in [&[file, one][..], &[one], &[one, file, file]] {
            assert!(!outputs_fit(wrong, <(Surface, Written) as Outputs>::FITS), "{wrong:?}");
        }
    }
}
