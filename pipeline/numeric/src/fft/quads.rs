//! Four complex transforms of the same length side by side, so that all operations act on vectors and no number moves
//! between lanes.
//!
//! For each number, the arithmetic is that of [`super::transform::Transform`]: the passes of `stockham.rs`, fused in pairs where possible
//! so that their 16 points stay in registers (half the traffic between the buffers), and Bluestein's chirp.

use super::Complex64;
use super::butterflies::{Butterfly, Number, Radix};
use super::stockham::{Pass, radices, turns};
use super::transform::Chirp;
use crate::simd::Vectors;
use pulp::{Simd, WithSimd, cast};
use std::ops::{Add, Sub};
use std::sync::Arc;

/// Number of transforms side by side.
pub const LANES: usize = 4;

/// One number of each of [`LANES`] transforms, which fill a cache line.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub struct Quad {
    pub re: [f64; LANES],
    pub im: [f64; LANES],
}

impl Quad {
    /// The value of one of eight lines stored in four pairs: lines with even numbers are real parts, the others imaginary parts.
    pub fn part(&self, line: usize) -> f64 {
        [&self.re, &self.im][line % 2][line / 2]
    }

    pub fn part_mut(&mut self, line: usize) -> &mut f64 {
        &mut [&mut self.re, &mut self.im][line % 2][line / 2]
    }

    fn times(&mut self, factor: Complex64) {
        for (re, im) in self.re.iter_mut().zip(&mut self.im) {
            let product = Complex64::new(*re, *im) * factor;
            (*re, *im) = (product.re, product.im);
        }
    }

    fn conjugate(&mut self) {
        self.im.iter_mut().for_each(|v| *v = -*v);
    }
}

/// Four transforms of a fixed length.
#[derive(Clone)]
pub struct QuadTransform {
    kind: Kind,
    vectors: Vectors,
}

#[derive(Clone)]
enum Kind {
    Direct(Arc<Plan>),
    Bluestein(Arc<(Chirp, Plan)>),
}

/// The two buffers of a transform.
pub struct Buffers {
    pub data: Vec<Quad>,
    other: Vec<Quad>,
}

impl QuadTransform {
    /// Transforms of `len` points.
    pub fn new(len: usize) -> Self {
        Self::with(len, Vectors::best())
    }

    pub(super) fn with(len: usize, vectors: Vectors) -> Self {
        let kind = match Plan::new(len) {
            Some(plan) => Kind::Direct(Arc::new(plan)),
            None => {
                let chirp = Chirp::new(len);
                // The chirp's length is smooth.
                let inner = Plan::new(chirp.spectrum.len()).unwrap_or_default();
                Kind::Bluestein(Arc::new((chirp, inner)))
            }
        };
        Self { kind, vectors }
    }

    pub fn buffers(&self) -> Buffers {
        let len = match &self.kind {
            Kind::Direct(plan) => plan.len,
            Kind::Bluestein(b) => b.1.len,
        };
        Buffers { data: vec![Quad::default(); len], other: vec![Quad::default(); len] }
    }

    /// Unscaled transforms of the leading numbers of `buffers.data`, which are overwritten.
    pub fn process<'a, const INVERSE: bool>(&self, buffers: &'a mut Buffers) -> &'a [Quad] {
        let Buffers { data, other } = buffers;
        match &self.kind {
            Kind::Direct(plan) => self.vectors.run(Passes::<INVERSE> { plan, data, other }).0,
            Kind::Bluestein(b) => convolve::<INVERSE>(&b.0, &b.1, self.vectors, data, other),
        }
    }
}

/// Bluestein's transform.
fn convolve<'a, const INVERSE: bool>(
    chirp: &Chirp,
    plan: &Plan,
    vectors: Vectors,
    data: &'a mut [Quad],
    other: &'a mut [Quad],
) -> &'a [Quad] {
    let (run, padding) = data.split_at_mut(chirp.values.len());
    padding.fill(Quad::default());
    for (v, c) in run.iter_mut().zip(&chirp.values) {
        if INVERSE {
            v.conjugate();
        }
        v.times(*c);
    }
    let (spectrum, spare) = vectors.run(Passes::<false> { plan, data, other });
    spectrum.iter_mut().zip(&chirp.spectrum).for_each(|(v, s)| v.times(*s));
    let (out, _) = vectors.run(Passes::<true> { plan, data: spectrum, other: spare });
    for (v, c) in out.iter_mut().zip(&chirp.values) {
        v.times(*c);
        if INVERSE {
            v.conjugate();
        }
    }
    out
}

/// The passes of one length.
#[derive(Default)]
pub(super) struct Plan {
    len: usize,
    passes: Vec<Pass>,
}

/// Two passes of radix 4 fused into one of radix 16. For each `p`, it holds the factors of the first pass at `p + m n / 16`, m from 0 to 3, then
/// those of the second pass at `p`.
fn fused(stride: usize, left: usize) -> Pass {
    let blocks = left / 16;
    let first = |p: usize| (0..4).flat_map(move |m| turns(4, left, p + m * blocks));
    let twiddles = (0..blocks).flat_map(|p| first(p).chain(turns(4, left / 4, p))).collect();
    Pass { radix: 16, stride, twiddles }
}

impl Plan {
    fn new(len: usize) -> Option<Self> {
        let radices = radices(len)?;
        let (mut rest, mut passes) = (&radices[..], Vec::new());
        let (mut left, mut stride) = (len, 1);
        while let [first, others @ ..] = rest {
            let (radix, after) = match others {
                [4, after @ ..] => (16, after),
                _ => (*first, others),
            };
            passes.push(if radix == 16 { fused(stride, left) } else { Pass::new(radix, stride, left) });
            (left, stride, rest) = (left / radix, stride * radix, after);
        }
        Some(Self { len, passes })
    }
}

/// All passes of a plan. Returns the buffer with the transforms, then the other buffer.
struct Passes<'a, 'b, const INVERSE: bool> {
    plan: &'b Plan,
    data: &'a mut [Quad],
    other: &'a mut [Quad],
}

impl<'a, const INVERSE: bool> WithSimd for Passes<'a, '_, INVERSE> {
    type Output = (&'a mut [Quad], &'a mut [Quad]);

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let len = self.plan.len;
        let (mut from, mut to) = (&mut self.data[..len], &mut self.other[..len]);
        for pass in &self.plan.passes {
            match pass.radix {
                16 => run_two::<S, INVERSE>(simd, pass, from, to),
                4 => run::<S, 4, INVERSE>(simd, pass, from, to),
                2 => run::<S, 2, INVERSE>(simd, pass, from, to),
                3 => run::<S, 3, INVERSE>(simd, pass, from, to),
                _ => run::<S, 5, INVERSE>(simd, pass, from, to),
            }
            std::mem::swap(&mut from, &mut to);
        }
        (from, to)
    }
}

/// One pass of radix `R`.
#[inline(always)]
fn run<S: Simd, const R: usize, const INVERSE: bool>(simd: S, pass: &Pass, from: &[Quad], to: &mut [Quad])
where
    Butterfly<R, INVERSE>: Radix<R>,
{
    let (stride, part) = (pass.stride, from.len() / R);
    let turns = pass.twiddles.chunks_exact(R - 1);
    for (p, (out, turns)) in to.chunks_exact_mut(R * stride).zip(turns).enumerate() {
        for q in 0..stride {
            let mut points = [Wide::load(simd, &from[p * stride + q]); R];
            for m in 1..R {
                points[m] = Wide::load(simd, &from[m * part + p * stride + q]);
            }
            let values = Butterfly::<R, INVERSE>::apply(points);
            values[0].store(&mut out[q]);
            for k in 1..R {
                values[k].turned::<INVERSE>(turns[k - 1]).store(&mut out[k * stride + q]);
            }
        }
    }
}

/// Two passes of radix 4. The 16 points are written out without a loop, which would move them through memory.
#[inline(always)]
fn run_two<S: Simd, const INVERSE: bool>(simd: S, pass: &Pass, from: &[Quad], to: &mut [Quad]) {
    let (stride, part) = (pass.stride, from.len() / 16);
    let turns = pass.twiddles.as_chunks::<3>().0.as_chunks::<5>().0;
    for (p, (out, turns)) in to.chunks_exact_mut(16 * stride).zip(turns).enumerate() {
        for q in 0..stride {
            let at = p * stride + q;
            let a = four::<S, INVERSE>(load_four(simd, from, at, 4 * part), &turns[0]);
            let b = four::<S, INVERSE>(load_four(simd, from, at + part, 4 * part), &turns[1]);
            let c = four::<S, INVERSE>(load_four(simd, from, at + 2 * part, 4 * part), &turns[2]);
            let d = four::<S, INVERSE>(load_four(simd, from, at + 3 * part, 4 * part), &turns[3]);
            store_four(four::<S, INVERSE>([a[0], b[0], c[0], d[0]], &turns[4]), out, q, 4 * stride);
            store_four(four::<S, INVERSE>([a[1], b[1], c[1], d[1]], &turns[4]), out, q + stride, 4 * stride);
            store_four(four::<S, INVERSE>([a[2], b[2], c[2], d[2]], &turns[4]), out, q + 2 * stride, 4 * stride);
            store_four(four::<S, INVERSE>([a[3], b[3], c[3], d[3]], &turns[4]), out, q + 3 * stride, 4 * stride);
        }
    }
}

/// Transform of four points, multiplied by its twiddle factors.
#[inline(always)]
fn four<S: Simd, const INVERSE: bool>(points: [Wide<S>; 4], turns: &[Complex64; 3]) -> [Wide<S>; 4] {
    let [a, b, c, d] = Butterfly::<4, INVERSE>::apply(points);
    [a, b.turned::<INVERSE>(turns[0]), c.turned::<INVERSE>(turns[1]), d.turned::<INVERSE>(turns[2])]
}

#[inline(always)]
fn load_four<S: Simd>(simd: S, from: &[Quad], at: usize, step: usize) -> [Wide<S>; 4] {
    [
        Wide::load(simd, &from[at]),
        Wide::load(simd, &from[at + step]),
        Wide::load(simd, &from[at + 2 * step]),
        Wide::load(simd, &from[at + 3 * step]),
    ]
}

#[inline(always)]
fn store_four<S: Simd>(values: [Wide<S>; 4], to: &mut [Quad], at: usize, step: usize) {
    values[0].store(&mut to[at]);
    values[1].store(&mut to[at + step]);
    values[2].store(&mut to[at + 2 * step]);
    values[3].store(&mut to[at + 3 * step]);
}

/// A [`Quad`] in vector registers.
#[derive(Clone, Copy)]
struct Wide<S: Simd> {
    simd: S,
    re: S::f64s,
    im: S::f64s,
}

impl<S: Simd> Wide<S> {
    #[inline(always)]
    fn load(simd: S, quad: &Quad) -> Self {
        Self { simd, re: cast(quad.re), im: cast(quad.im) }
    }

    #[inline(always)]
    fn store(self, quad: &mut Quad) {
        *quad = Quad { re: cast(self.re), im: cast(self.im) };
    }
}

impl<S: Simd> Add for Wide<S> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { re: self.simd.add_f64s(self.re, other.re), im: self.simd.add_f64s(self.im, other.im), ..self }
    }
}

impl<S: Simd> Sub for Wide<S> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { re: self.simd.sub_f64s(self.re, other.re), im: self.simd.sub_f64s(self.im, other.im), ..self }
    }
}

impl<S: Simd> Number for Wide<S> {
    #[inline(always)]
    fn scaled(self, by: f64) -> Self {
        let by = self.simd.splat_f64s(by);
        Self { re: self.simd.mul_f64s(self.re, by), im: self.simd.mul_f64s(self.im, by), ..self }
    }

    #[inline(always)]
    fn turned<const INVERSE: bool>(self, turn: Complex64) -> Self {
        let simd = self.simd;
        let (cos, sin) = (simd.splat_f64s(turn.re), simd.splat_f64s(turn.im));
        let (re_cos, re_sin) = (simd.mul_f64s(self.re, cos), simd.mul_f64s(self.re, sin));
        let (im_cos, im_sin) = (simd.mul_f64s(self.im, cos), simd.mul_f64s(self.im, sin));
        let (re, im) = match INVERSE {
            true => (simd.add_f64s(re_cos, im_sin), simd.sub_f64s(im_cos, re_sin)),
            false => (simd.sub_f64s(re_cos, im_sin), simd.add_f64s(re_sin, im_cos)),
        };
        Self { simd, re, im }
    }

    #[inline(always)]
    fn either_side<const INVERSE: bool>(self, side: Self) -> [Self; 2] {
        let simd = self.simd;
        let right = Self { simd, re: simd.add_f64s(self.re, side.im), im: simd.sub_f64s(self.im, side.re) };
        let left = Self { simd, re: simd.sub_f64s(self.re, side.im), im: simd.add_f64s(self.im, side.re) };
        if INVERSE { [left, right] } else { [right, left] }
    }
}
