//! Many short lists in one array.

use std::ops::Range;

/// Lists of items, one after another in one array (compressed sparse rows).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lists<T> {
    /// Start of each list, and the number of items.
    starts: Vec<usize>,
    items: Vec<T>,
}

impl<T> Lists<T> {
    /// Number of lists.
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// True without lists.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Where the items of a list are among all.
    #[inline]
    pub fn range(&self, list: usize) -> Range<usize> {
        self.starts[list]..self.starts[list + 1]
    }

    /// The items of a list.
    #[inline]
    pub fn of(&self, list: usize) -> &[T] {
        &self.items[self.range(list)]
    }

    /// The same, writable.
    #[inline]
    pub fn of_mut(&mut self, list: usize) -> &mut [T] {
        let range = self.range(list);
        &mut self.items[range]
    }

    /// The lists in order.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = &[T]> + ExactSizeIterator {
        (0..self.len()).map(|list| self.of(list))
    }

    /// Start of each list, and the number of items.
    pub fn starts(&self) -> &[usize] {
        &self.starts
    }

    /// The items of all lists.
    pub fn items(&self) -> &[T] {
        &self.items
    }
}

impl<T: Copy + Default> Lists<T> {
    /// Distributes `(list, item)` pairs over `count` lists by counting, in linear time; items of a list stay in their order.
    ///
    /// # Panics
    /// If a list is not below `count`.
    ///
    /// ```
    /// use plumbline_num::math::Lists;
    ///
    /// let neighbors = Lists::new(3, [(0, 'b'), (2, 'a'), (0, 'c')].into_iter());
    /// assert_eq!([neighbors.of(0), neighbors.of(1)], [&['b', 'c'][..], &[]]);
    /// ```
    pub fn new(count: usize, pairs: impl Iterator<Item = (u32, T)> + Clone) -> Self {
        let mut starts = vec![0; count + 1];
        pairs.clone().for_each(|(list, _)| starts[list as usize + 1] += 1);
        (0..count).for_each(|list| starts[list + 1] += starts[list]);
        let (mut next, mut items) = (starts.clone(), vec![T::default(); starts[count]]);
        // `for_each`, not a loop: flattened iterators are faster when they drive the body themselves.
        pairs.for_each(|(list, item)| {
            items[next[list as usize]] = item;
            next[list as usize] += 1;
        });
        Self { starts, items }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_keep_their_order_and_lists_may_be_empty() {
        let pairs = [(2, 'a'), (0, 'b'), (2, 'c'), (0, 'd'), (2, 'e')];
        let lists = Lists::new(4, pairs.into_iter());
        let of: Vec<String> = lists.iter().map(|list| list.iter().collect()).collect();
        assert_eq!(of, ["bd", "", "ace", ""]);
        assert_eq!((lists.len(), lists.range(2), lists.items().len()), (4, 2..5, 5));
        assert!(Lists::<u32>::new(0, std::iter::empty()).is_empty());
    }
}
