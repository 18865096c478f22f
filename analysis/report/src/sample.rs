//! Random samples of what is too much to draw or to list.

use sastrugi_numeric::Stream;

/// Maximum number of rows of a table or behind a figure under `data/`.
pub const ROWS_MAX: usize = 20_000;

/// `most` of the items, each equally likely, in their order; all of them if there are no more. By Knuth's algorithm S (The Art of Computer
/// Programming 2, section 3.4.2): one draw for each item.
///
/// ```
/// use sastrugi_numeric::Streams;
/// use sastrugi_report::sample::sample;
///
/// let mut stream = Streams::for_seed(1, "example").stream("sample");
/// assert_eq!(sample(vec!["a", "b"], 2, &mut stream), ["a", "b"]);
/// let some = sample((0..1000).collect(), 10, &mut stream);
/// assert!(some.len() == 10 && some.is_sorted());
/// ```
pub fn sample<T>(items: Vec<T>, most: usize, stream: &mut Stream) -> Vec<T> {
    let all = items.len();
    if all <= most {
        return items;
    }
    let mut wanted = most;
    let mut is_drawn = |place: usize| {
        let drawn = stream.below((all - place) as u64) < wanted as u64;
        wanted -= usize::from(drawn);
        drawn
    };
    let drawn = items.into_iter().enumerate().filter_map(|(place, item)| is_drawn(place).then_some(item));
    let mut drawn: Vec<T> = drawn.collect();
    // The sample may have been collected in place, with the room of all items.
    drawn.shrink_to_fit();
    drawn
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Streams;

    fn stream(purpose: &str) -> Stream {
        Streams::for_seed(1, "sample-test").stream(purpose)
    }

    #[test]
    fn prop_samples_have_their_size_and_order() {
        for (all, most) in [(0, 0), (0, 3), (3, 3), (4, 3), (5, 0), (1000, 999), (1000, 1)] {
            let drawn = sample((0..all).collect::<Vec<usize>>(), most, &mut stream("size"));
            assert_eq!(drawn.len(), all.min(most));
            assert!(drawn.capacity() < all.min(most) + 64, "{}", drawn.capacity());
            assert!(drawn.is_sorted_by(|a, b| a < b));
        }
        let again = || sample((0..100).collect::<Vec<usize>>(), 10, &mut stream("again"));
        assert_eq!(again(), again());
    }

    /// Null: each of ten items is in a sample of three with probability 3/10, and each pair with 3/10 x 2/9 = 1/15. 20 000 samples; bounds are
    /// five standard deviations of a count, 324 and 177 (false alarm 10 x 6e-7 + 45 x 6e-7).
    #[test]
    fn stat_items_and_pairs_are_equally_likely() {
        let mut stream = stream("uniform");
        let (mut items, mut pairs) = ([0_usize; 10], [[0_usize; 10]; 10]);
        for _ in 0..20_000 {
            let drawn = sample((0..10).collect::<Vec<usize>>(), 3, &mut stream);
            drawn.iter().for_each(|k| items[*k] += 1);
            for (k, a) in drawn.iter().enumerate() {
                drawn[k + 1..].iter().for_each(|b| pairs[*a][*b] += 1);
            }
        }
        assert!(items.iter().all(|n| n.abs_diff(6000) <= 324), "{items:?}");
        let each = (0..10).flat_map(|a| (a + 1..10).map(move |b| (a, b)));
        assert!(each.into_iter().all(|(a, b)| pairs[a][b].abs_diff(1333) <= 177), "{pairs:?}");
    }
}
