//! What the four contracts have in common at the border, made of a list of their methods.

/// Makes a contract's table, the plugin's side of it and the host's calls.
///
/// Each method is `access name(plugin, argument: type, …) -> answer = Method { body }`: `access` says whether the plugin is shared
/// (`ref`) or not (`mut`) meanwhile, the arguments are those that cross, `answer` is what is written for the host, and the body
/// calls the plugin and gives a `Result`; it runs where a panic is caught. The functions in brackets return by value, and their
/// modules write them by hand.
///
/// - `Table`: the functions in `extern "C"`, with a number for its layout.
/// - `$constructor`: the description of a plugin of this kind, which `plugin!` calls.
/// - `Calls`: an opened plugin, with a method for each of the list, which gives what was written: the answer or the error.
macro_rules! contract {
    (
        $(#[$doc:meta])*
        $constructor:ident: $contract:ident, $kind:ident($($context:ident)?), $new:ident, $drop:ident;
        $(
            $access:ident $name:ident($plugin:ident $(, $argument:ident: $type:ty)*) -> $answer:ty = $method:ident $body:block
        )+
        $([$($field:ident: $function:ty = $value:expr),+ $(,)?])?
    ) => {
        type Errors = *mut $crate::PluginError;

        $crate::abi::layout::table! {
            $(#[$doc])*
            pub struct Table {
                make: unsafe extern "C" fn(
                    $crate::Slice<'static, u8>,
                    $crate::Slice<'_, u8>,
                    $(*const $context,)?
                    *mut *mut std::ffi::c_void,
                    Errors,
                ) -> u32,
                free: unsafe extern "C" fn(*mut std::ffi::c_void),
                $($name: unsafe extern "C" fn(*mut std::ffi::c_void, $($type,)* *mut $answer, Errors) -> u32,)+
                $($($field: $function),+)?
            }
        }

        /// The plugin `name` of what `open` makes from its options.
        pub const fn $constructor<T, O, F>(
            name: &'static str,
            version: &'static str,
            _open: F,
        ) -> $crate::abi::Descriptor
        where
            T: $contract + 'static,
            O: $crate::PluginOptions + 'static,
            F: Fn(&O $(, &$context)?) -> Result<T, $crate::PluginError> + Copy + 'static,
        {
            let options = $crate::abi::entry::describe::<O>;
            $crate::abi::Descriptor::new($crate::PluginKind::$kind, (name, version), options, &Adapter::<T, O, F>::TABLE)
        }

        /// The plugin's side: the types that a table forgets.
        struct Adapter<T, O, F>(std::marker::PhantomData<(T, O, F)>);

        impl<T, O, F> Adapter<T, O, F>
        where
            T: $contract + 'static,
            O: $crate::PluginOptions + 'static,
            F: Fn(&O $(, &$context)?) -> Result<T, $crate::PluginError> + Copy + 'static,
        {
            const TABLE: Table = Table {
                make: Self::make,
                free: $crate::abi::entry::close::<T>,
                $($name: Self::$name,)+
                $($($field: $value),+)?
            };

            unsafe extern "C" fn make(
                name: $crate::Slice<'static, u8>,
                options: $crate::Slice<'_, u8>,
                $(context: *const $context,)?
                handle: *mut *mut std::ffi::c_void,
                error: Errors,
            ) -> u32 {
                use $crate::abi::entry::{function, open};
                // SAFETY: the host gives what lives for the call, and places that can be written to.
                unsafe {
                    open(name, options, handle, error, |options: &O| {
                        function::<F>()(options $(, &*context.cast::<$context>())?)
                    })
                }
            }

            $(
                unsafe extern "C" fn $name(
                    this: *mut std::ffi::c_void,
                    $($argument: $type,)*
                    answer: *mut $answer,
                    error: Errors,
                ) -> u32 {
                    // SAFETY: the host passes the handle that `make` gave, places that can be written to, and references that live
                    // for the call; it calls a plugin whose methods are not `ref` from one thread at a time.
                    unsafe {
                        $crate::abi::contract::instance!($access this: T, $plugin, guard);
                        guard.run_into(stringify!($name), answer, error, || $body)
                    }
                }
            )+
        }

        /// The host's side: an opened plugin, and the functions of its table as they are.
        struct Calls {
            table: &'static Table,
            handle: $crate::abi::entry::Handle,
        }

        impl Calls {
            /// Opens a plugin of the table.
            fn make(
                table: &'static Table,
                name: &'static str,
                options: &str
                $(, context: &$context)?
            ) -> Result<Self, $crate::PluginError> {
                use $crate::abi::watch::Method;
                let name = $crate::Slice::new(name.as_bytes());
                let options = $crate::Slice::new(options.as_bytes());
                let methods = [Method::$new, Method::$drop];
                // SAFETY: everything lives for the call.
                let handle = $crate::abi::entry::Handle::open(methods, table.free, |handle, error| unsafe {
                    (table.make)(name, options, $(std::ptr::from_ref::<$context>(context),)? handle, error)
                })?;
                Ok(Self { table, handle })
            }

            $(
                #[inline]
                fn $name(&self $(, $argument: $type)*) -> Result<$answer, $crate::PluginError> {
                    // SAFETY: the handle is open, `ask` gives places to write to; what the arguments point at lives for the
                    // call, which is the promise of the one place that makes it.
                    $crate::abi::entry::ask($crate::abi::watch::Method::$method, |answer, error| unsafe {
                        (self.table.$name)(self.handle.instance $(, $argument)*, answer, error)
                    })
                }
            )+
        }
    };
}

/// The plugin behind a handle and its guard, by names of the caller's.
macro_rules! instance {
    (ref $this:ident: $type:ty, $plugin:ident, $guard:ident) => {
        let $crate::abi::entry::Instance {
            plugin: $plugin,
            guard: $guard,
        } = &*$this.cast::<$crate::abi::entry::Instance<$type>>();
    };
    (mut $this:ident: $type:ty, $plugin:ident, $guard:ident) => {
        let $crate::abi::entry::Instance {
            plugin: $plugin,
            guard: $guard,
        } = &mut *$this.cast::<$crate::abi::entry::Instance<$type>>();
    };
}

pub(crate) use {contract, instance};
