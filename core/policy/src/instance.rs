//! One live module: its store, its memory, its functions.

use wasmtime::{Memory, Store, Trap, TypedFunc, WasmParams, WasmResults};

use crate::abi;
use crate::bounds::Asks;
use crate::budget::Budget;
use crate::error::{Refusal, Trouble};
use crate::geometry::Geometry;
use crate::inputs::{Input, Places};
use crate::layout::Layout;
use crate::limits::Limits;
use crate::parameters::{Parameter, resolve};
use crate::script::{Script, layout_export};
use crate::window::{Record, Sight};

/// A live script. After an error of a call it must not be called again.
pub struct Instance {
    store: Store<Limits>,
    memory: Memory,
    layout: Layout,
    budget: Budget,
    blocks: Option<TypedFunc<(u32, u32), ()>>,
    period: Option<TypedFunc<u32, f64>>,
    save: Option<TypedFunc<(), u32>>,
    restore: Option<TypedFunc<u32, ()>>,
    /// Fuel that the last call used.
    pub fuel_used: u64,
}

impl Instance {
    /// Starts `script` with the parameters `stated`, by name. Allocates.
    ///
    /// # Errors
    /// It does not start within its budget, its layout is wrong, or the parameters do not fit.
    pub fn new(
        script: &Script,
        budget: &Budget,
        stated: &[(String, f64)],
    ) -> Result<Self, Refusal> {
        let mut store = Store::new(script.module.engine(), Limits::new(budget));
        store.limiter(|limits| limits);
        let fuel = budget.start();
        let _ = store.set_fuel(fuel);
        let made = wasmtime::Instance::new(&mut store, &script.module, &[]);
        let instance = made.map_err(|e| Refusal::Start(trouble(&mut store, &e, fuel)))?;
        let missing = || Refusal::Exports(vec!["an export has gone".to_string()]);
        let memory = instance
            .get_memory(&mut store, abi::MEMORY_EXPORT)
            .ok_or_else(missing)?;
        let locate = instance
            .get_typed_func::<(), u32>(&mut store, layout_export(script.version))
            .map_err(|_| missing())?;
        let located = locate.call(&mut store, ());
        let address = located.map_err(|e| Refusal::Start(trouble(&mut store, &e, fuel)))?;
        let layout = Layout::read(memory.data(&store), address, script.version)?;
        let values = resolve(&layout.declared, stated)?;
        for (index, value) in values.iter().enumerate() {
            abi::put_f64(memory.data_mut(&mut store), layout.value(index), *value);
        }
        Ok(Self {
            blocks: instance.get_typed_func(&mut store, abi::BLOCKS_EXPORT).ok(),
            period: instance.get_typed_func(&mut store, abi::PERIOD_EXPORT).ok(),
            save: instance.get_typed_func(&mut store, abi::SAVE_EXPORT).ok(),
            restore: instance
                .get_typed_func(&mut store, abi::RESTORE_EXPORT)
                .ok(),
            store,
            memory,
            layout,
            budget: *budget,
            fuel_used: 0,
        })
    }

    /// The parameters that the script declares.
    pub fn parameters(&self) -> &[Parameter] {
        &self.layout.declared
    }

    /// What the script wants to see.
    pub fn inputs(&self) -> &[Input] {
        &self.layout.inputs
    }

    /// Tells the script where its inputs are, before the first call.
    pub fn place(&mut self, places: &Places) {
        let memory = self.memory.data_mut(&mut self.store);
        for (index, place) in places.told.iter().enumerate() {
            abi::put_u32(memory, self.layout.place_of_input(index), *place);
        }
    }

    /// Whether it looks at the geometry of blocks.
    pub fn sees_geometry(&self) -> bool {
        self.layout.block_bytes >= abi::block::BYTES_V2
    }

    /// Pages of memory in use.
    pub fn memory_pages(&self) -> u64 {
        self.memory.size(&self.store)
    }

    /// Hands over the window of `records`, and appends what is asked for to `asks`. A script of version 2 also gets `sights`,
    /// and one that looks at the geometry of blocks `geometries`, one a record each; others pass them over. Does not allocate
    /// where `asks` has room.
    ///
    /// # Errors
    /// What went wrong in the script. An infinite number in an answer is an error too.
    pub fn blocks(
        &mut self,
        records: &[Record],
        sights: &[Sight],
        geometries: &[Geometry],
        asks: &mut Vec<Asks>,
    ) -> Result<(), Trouble> {
        let Some(function) = &self.blocks else {
            return Ok(());
        };
        let (window, stride) = (self.layout.window, self.layout.block_bytes);
        let memory = self.memory.data_mut(&mut self.store);
        let places = memory[window..].chunks_exact_mut(stride);
        if stride == abi::block::BYTES {
            memory[window..][..records.len() * stride].copy_from_slice(records.as_flattened());
        } else {
            for (index, (place, record)) in places.zip(records).enumerate() {
                let (own, rest) = place.split_at_mut(abi::block::BYTES);
                own.copy_from_slice(record);
                let Some((sight, rest)) = rest.split_at_mut_checked(size_of::<Sight>()) else {
                    continue;
                };
                if let Some(seen) = sights.get(index) {
                    sight.copy_from_slice(seen);
                }
                if let Some(geometry) = geometries.get(index)
                    && rest.len() >= geometry.len()
                {
                    rest[..geometry.len()].copy_from_slice(geometry);
                }
            }
        }
        let fuel = self.budget.window(records.len());
        let answer = call(
            &mut self.store,
            function,
            (window as u32, records.len() as u32),
            fuel,
        );
        self.fuel_used = fuel_used(&self.store, fuel);
        answer?;
        let answered = self.memory.data(&self.store)[window..]
            .chunks_exact(stride)
            .take(records.len());
        asks.extend(answered.map(read_asks));
        asks.iter()
            .flatten()
            .position(|ask| ask.is_infinite())
            .map_or(Ok(()), |at| {
                const NAMES: [&str; 3] = ["a time constant", "a path tolerance", "a feed cap"];
                Err(not_finite(NAMES[at % 3], asks[at / 3][at % 3]))
            })
    }

    /// Hands over the means of a rough period, as [`abi::period`] lays them out; gives the ratio, NaN for none. Does not
    /// allocate.
    ///
    /// # Errors
    /// What went wrong in the script.
    pub fn period(&mut self, record: &[u8]) -> Result<f64, Trouble> {
        let Some(function) = &self.period else {
            return Ok(f64::NAN);
        };
        let (place, fuel) = (self.layout.period, self.budget.fuel_per_call);
        self.memory.data_mut(&mut self.store)[place..][..record.len()].copy_from_slice(record);
        let answer = call(&mut self.store, function, place as u32, fuel);
        self.fuel_used = fuel_used(&self.store, fuel);
        let ratio = answer?;
        if ratio.is_infinite() {
            Err(not_finite("a ratio", ratio))
        } else {
            Ok(ratio)
        }
    }

    /// What must survive a reload. Allocates.
    ///
    /// # Errors
    /// What went wrong in the script.
    pub fn save(&mut self) -> Result<Vec<u8>, Trouble> {
        let Some(function) = &self.save else {
            return Ok(vec![]);
        };
        let bytes = call(&mut self.store, function, (), self.budget.fuel_per_call)? as usize;
        if bytes > self.layout.state_bytes {
            return Err(Trouble::Trap(format!(
                "save gave {bytes} bytes, the buffer has {}",
                self.layout.state_bytes
            )));
        }
        let start = self.layout.state;
        Ok(self.memory.data(&self.store)[start..start + bytes].to_vec())
    }

    /// Hands over what another instance saved; more than fits is left out as a whole.
    ///
    /// # Errors
    /// What went wrong in the script.
    pub fn restore(&mut self, state: &[u8]) -> Result<(), Trouble> {
        let Some(function) = &self.restore else {
            return Ok(());
        };
        if state.is_empty() || state.len() > self.layout.state_bytes {
            return Ok(());
        }
        let start = self.layout.state;
        self.memory.data_mut(&mut self.store)[start..start + state.len()].copy_from_slice(state);
        call(
            &mut self.store,
            function,
            state.len() as u32,
            self.budget.fuel_per_call,
        )
    }
}

/// Calls `function` with `fuel`.
fn call<P: WasmParams, R: WasmResults>(
    store: &mut Store<Limits>,
    function: &TypedFunc<P, R>,
    arguments: P,
    fuel: u64,
) -> Result<R, Trouble> {
    let _ = store.set_fuel(fuel);
    function
        .call(&mut *store, arguments)
        .map_err(|e| trouble(store, &e, fuel))
}

/// What a call with `fuel` has used.
fn fuel_used(store: &Store<Limits>, fuel: u64) -> u64 {
    fuel - store.get_fuel().unwrap_or(0).min(fuel)
}

/// What a record that has come back asks for.
fn read_asks(record: &[u8]) -> Asks {
    let at = abi::block::ASK_TIME_CONSTANT;
    let asks: &[u8; 24] = record[at..].first_chunk().unwrap_or(&[0xff; 24]);
    std::array::from_fn(|index| {
        f64::from_le_bytes(std::array::from_fn(|byte| asks[8 * index + byte]))
    })
}

fn not_finite(what: &'static str, value: f64) -> Trouble {
    Trouble::NotFinite {
        what,
        value: value.to_string(),
    }
}

fn trouble(store: &mut Store<Limits>, error: &wasmtime::Error, fuel: u64) -> Trouble {
    if let Some(asked) = store.data_mut().refused.take() {
        return Trouble::Memory(asked);
    }
    match error.downcast_ref::<Trap>() {
        Some(Trap::OutOfFuel) => Trouble::Fuel(fuel),
        Some(Trap::StackOverflow) => Trouble::Stack,
        Some(other) => Trouble::Trap(
            other
                .to_string()
                .trim_start_matches("wasm trap: ")
                .to_string(),
        ),
        None => Trouble::Trap(
            format!("{error:#}")
                .chars()
                .filter(|c| !c.is_control())
                .take(200)
                .collect(),
        ),
    }
}
