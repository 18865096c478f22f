//! Priority queue of open vertices, as a heap with four children per node: half as deep as a binary one, and siblings share a cache line.

/// An open vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Open {
    /// Bits of the sum and of the cost so far; for floats of 0 or above, the order of the bits is the order of the values.
    pub(super) sum: u64,
    pub(super) so_far: u64,
    pub(super) vertex: u32,
}

impl Open {
    pub(crate) fn new(sum: f64, so_far: f64, vertex: u32) -> Self {
        Self { sum: sum.to_bits(), so_far: so_far.to_bits(), vertex }
    }

    pub(crate) fn vertex(&self) -> u32 {
        self.vertex
    }

    /// Sort key: cost so far plus bound.
    pub(crate) fn sum(&self) -> f64 {
        f64::from_bits(self.sum)
    }

    /// Cost so far.
    pub(crate) fn so_far(&self) -> f64 {
        f64::from_bits(self.so_far)
    }

    /// Smaller sum first, then larger cost so far, then smaller number.
    fn is_before(&self, other: &Self) -> bool {
        if self.sum != other.sum {
            return self.sum < other.sum;
        }
        (other.so_far, self.vertex) < (self.so_far, other.vertex)
    }
}

/// Children of a node of the heap.
const CHILDREN: usize = 4;

/// Vertices in the order of [`Open::is_before`].
#[derive(Clone, Debug, Default)]
pub(crate) struct Queue {
    heap: Vec<Open>,
}

impl Queue {
    /// All open vertices, in no particular order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &Open> {
        self.heap.iter()
    }

    pub(crate) fn push(&mut self, open: Open) {
        let mut at = self.heap.len();
        self.heap.push(open);
        while at > 0 {
            let parent = (at - 1) / CHILDREN;
            if !open.is_before(&self.heap[parent]) {
                break;
            }
            self.heap[at] = self.heap[parent];
            at = parent;
        }
        self.heap[at] = open;
    }

    pub(crate) fn pop(&mut self) -> Option<Open> {
        let first = *self.heap.first()?;
        let last = self.heap.pop()?;
        if !self.heap.is_empty() {
            self.sink(last);
        }
        Some(first)
    }

    /// Replaces the root and sifts the vertex down.
    fn sink(&mut self, open: Open) {
        let mut at = 0;
        loop {
            let first = CHILDREN * at + 1;
            let children = first..(first + CHILDREN).min(self.heap.len());
            let earlier = |a: usize, b: usize| if self.heap[b].is_before(&self.heap[a]) { b } else { a };
            let Some(child) = children.reduce(earlier).filter(|child| self.heap[*child].is_before(&open)) else {
                break;
            };
            self.heap[at] = self.heap[child];
            at = child;
        }
        self.heap[at] = open;
    }
}
