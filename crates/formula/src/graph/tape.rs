//! Instructions that compute some nodes of a graph for batches of observations.

use depthcal_model::Context;

use super::node::{Binary, Graph, Id, Input, Operation, Unary, spline};

/// A step of a [`Tape`]; its result is the register of its own number.
#[derive(Debug, Clone, Copy)]
enum Instruction {
    Constant(f64),
    Input(Input),
    Unary(Unary, u32),
    Binary(Binary, u32, u32),
    /// A spline of the register `t`, with the registers of its coefficients as a part of [`Tape::coefficients`].
    Spline {
        order: u8,
        t: u32,
        first: u32,
        count: u32,
    },
}

/// Instructions in the order in which they run.
#[derive(Debug, Clone)]
pub(crate) struct Tape {
    instructions: Vec<Instruction>,
    /// Registers of the coefficients of splines.
    coefficients: Vec<u32>,
    /// Registers of the results, in the order asked for.
    outputs: Vec<u32>,
}

/// Observations that pass through the instructions together: their registers stay in the first-level cache.
const CHUNK: usize = 32;
/// Registers of one observation that are kept on the stack.
const ON_STACK: usize = 96;

impl Tape {
    /// The instructions that compute `outputs`, each once.
    pub fn new(graph: &Graph, outputs: &[Id]) -> Self {
        let highest = outputs.iter().copied().max().map_or(0, |id| id as usize + 1);
        let mut needed = vec![false; highest];
        outputs.iter().for_each(|id| needed[*id as usize] = true);
        // Parts have lower numbers than what is made of them.
        for id in (0..highest).rev() {
            if needed[id] {
                for_each_part(graph, graph.operation(id as Id), |part| needed[part as usize] = true);
            }
        }
        let mut register = vec![u32::MAX; highest];
        let (mut instructions, mut coefficients) = (Vec::new(), Vec::new());
        for id in (0..highest).filter(|id| needed[*id]) {
            register[id] = instructions.len() as u32;
            instructions.push(match graph.operation(id as Id) {
                Operation::Constant(value) => Instruction::Constant(value),
                Operation::Input(input) => Instruction::Input(input),
                Operation::Unary(unary, a) => Instruction::Unary(unary, register[a as usize]),
                Operation::Binary(binary, a, b) => {
                    Instruction::Binary(binary, register[a as usize], register[b as usize])
                }
                Operation::Spline { order, t, coefficients: list } => {
                    let (list, first) = (graph.coefficients(list), coefficients.len() as u32);
                    coefficients.extend(list.iter().map(|coefficient| register[*coefficient as usize]));
                    Instruction::Spline { order, t: register[t as usize], first, count: list.len() as u32 }
                }
            });
        }
        Self { instructions, coefficients, outputs: outputs.iter().map(|id| register[*id as usize]).collect() }
    }

    /// Runs over a batch: `states` has `inputs` numbers per observation. `store` gets the number of the observation, that of
    /// the output, and its value.
    pub fn run(
        &self,
        theta: &[f64],
        states: &[f64],
        inputs: usize,
        contexts: &[Context],
        mut store: impl FnMut(usize, usize, f64),
    ) {
        if let [context] = contexts
            && self.instructions.len() <= ON_STACK
        {
            let mut registers = [0.0; ON_STACK];
            self.one(theta, states, context, &mut registers);
            self.outputs.iter().enumerate().for_each(|(k, r)| store(0, k, registers[*r as usize]));
            return;
        }
        let mut registers = vec![0.0; self.instructions.len() * CHUNK];
        for (chunk, contexts) in contexts.chunks(CHUNK).enumerate() {
            let first = chunk * CHUNK;
            self.several(theta, &states[first * inputs..], inputs, contexts, &mut registers);
            for (k, r) in self.outputs.iter().enumerate() {
                let values = &registers[*r as usize * CHUNK..][..contexts.len()];
                values.iter().enumerate().for_each(|(i, value)| store(first + i, k, *value));
            }
        }
    }

    #[inline]
    fn one(&self, theta: &[f64], state: &[f64], context: &Context, registers: &mut [f64; ON_STACK]) {
        for (i, instruction) in self.instructions.iter().enumerate() {
            let register = |r: u32| registers[r as usize];
            registers[i] = match *instruction {
                Instruction::Constant(value) => value,
                Instruction::Input(Input::State(k)) => state[usize::from(k)],
                Instruction::Input(Input::Theta(k)) => theta[usize::from(k)],
                Instruction::Input(Input::Context(covariate)) => covariate.of_context(context),
                Instruction::Unary(unary, a) => unary.of(register(a)),
                Instruction::Binary(binary, a, b) => binary.of(register(a), register(b)),
                Instruction::Spline { order, t, first, count } => {
                    let coefficients = &self.coefficients[first as usize..][..count as usize];
                    spline(order, register(t), coefficients.len(), |c| register(coefficients[c]))
                }
            };
        }
    }

    fn several(&self, theta: &[f64], states: &[f64], inputs: usize, contexts: &[Context], registers: &mut [f64]) {
        let n = contexts.len();
        for (i, instruction) in self.instructions.iter().enumerate() {
            let (before, from_here) = registers.split_at_mut(i * CHUNK);
            let out = &mut from_here[..n];
            let part = |r: u32| &before[r as usize * CHUNK..][..n];
            match *instruction {
                Instruction::Constant(value) => out.fill(value),
                Instruction::Input(Input::Theta(k)) => out.fill(theta[usize::from(k)]),
                Instruction::Input(Input::State(k)) => {
                    let column = states.iter().skip(usize::from(k)).step_by(inputs);
                    out.iter_mut().zip(column).for_each(|(out, value)| *out = *value);
                }
                Instruction::Input(Input::Context(covariate)) => {
                    out.iter_mut().zip(contexts).for_each(|(out, context)| *out = covariate.of_context(context));
                }
                Instruction::Unary(unary, a) => unary_batch(unary, part(a), out),
                Instruction::Binary(binary, a, b) => binary_batch(binary, part(a), part(b), out),
                Instruction::Spline { order, t, first, count } => {
                    let coefficients = &self.coefficients[first as usize..][..count as usize];
                    for (k, (t, out)) in part(t).iter().zip(out).enumerate() {
                        *out = spline(order, *t, coefficients.len(), |c| before[coefficients[c] as usize * CHUNK + k]);
                    }
                }
            }
        }
    }
}

/// Hands on the nodes that an operation is made of.
fn for_each_part(graph: &Graph, operation: Operation, mut part: impl FnMut(Id)) {
    match operation {
        Operation::Constant(_) | Operation::Input(_) => {}
        Operation::Unary(_, a) => part(a),
        Operation::Binary(_, a, b) => [a, b].into_iter().for_each(part),
        Operation::Spline { t, coefficients, .. } => {
            part(t);
            graph.coefficients(coefficients).iter().copied().for_each(part);
        }
    }
}

/// One function over a batch; the choice is made once, outside the loop.
fn unary_batch(unary: Unary, a: &[f64], out: &mut [f64]) {
    macro_rules! each {
        ($($which:pat => $unary:expr),* $(,)?) => {
            match unary {
                $($which => a.iter().zip(out).for_each(|(a, out)| *out = $unary.of(*a)),)*
            }
        };
    }
    each!(
        Unary::Negative => Unary::Negative,
        Unary::Sqrt => Unary::Sqrt,
        Unary::Abs => Unary::Abs,
        Unary::Step => Unary::Step,
        Unary::BSpline(0) => Unary::BSpline(0),
        Unary::BSpline(1) => Unary::BSpline(1),
        other => other,
    );
}

fn binary_batch(binary: Binary, a: &[f64], b: &[f64], out: &mut [f64]) {
    macro_rules! each {
        ($($which:pat => $binary:expr),* $(,)?) => {
            match binary {
                $($which => a.iter().zip(b).zip(out).for_each(|((a, b), out)| *out = $binary.of(*a, *b)),)*
            }
        };
    }
    each!(
        Binary::Add => Binary::Add,
        Binary::Subtract => Binary::Subtract,
        Binary::Multiply => Binary::Multiply,
        Binary::Divide => Binary::Divide,
        other => other,
    );
}
