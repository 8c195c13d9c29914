//! One source, several instruction sets: row kernels that the compiler vectorizes, chosen at run time.
//!
//! [`multiversion!`] compiles the same body twice, once for the baseline and once with AVX2, and calls the wider one where
//! the processor has it. Both twins are the same integer or unfused floating-point arithmetic (Rust never contracts a
//! multiply and an add), so they agree bit for bit and results do not depend on the machine.

/// Defines a function whose body is also compiled for AVX2 and dispatched at run time.
#[macro_export]
macro_rules! multiversion {
    ($(#[$meta:meta])* $vis:vis fn $name:ident($($arg:ident : $ty:ty),* $(,)?) $(-> $ret:ty)? $body:block) => {
        $(#[$meta])*
        $vis fn $name($($arg: $ty),*) $(-> $ret)? {
            #[inline(always)]
            #[allow(clippy::inline_always)] // each twin must compile the body with its own instruction set
            fn body($($arg: $ty),*) $(-> $ret)? $body

            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn avx2($($arg: $ty),*) $(-> $ret)? {
                    body($($arg),*)
                }
                if std::arch::is_x86_feature_detected!("avx2") {
                    // SAFETY: the body is safe code, and the one feature it is compiled for has just been detected.
                    #[allow(unsafe_code)]
                    return unsafe { avx2($($arg),*) };
                }
            }
            body($($arg),*)
        }
    };
}

pub use crate::multiversion;
