//! Rows of numbers that are mostly 0, one for each observation: only the others are stored.

/// Rows without their zeros.
#[derive(Debug, Clone, Default)]
pub(super) struct SparseRows {
    /// Index in its row and value; ascending within a row.
    entries: Vec<(u32, f32)>,
    /// For each row the end of its entries.
    ends: Vec<usize>,
    /// Index of the next value of the row that is being written.
    next: u32,
}

impl SparseRows {
    /// Number of complete rows.
    pub(super) fn len(&self) -> usize {
        self.ends.len()
    }

    /// Removes all rows. Keeps the memory.
    pub(super) fn clear(&mut self) {
        self.entries.clear();
        self.ends.clear();
        self.next = 0;
    }

    /// The entries of each row.
    pub(super) fn iter(&self) -> impl Iterator<Item = &[(u32, f32)]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts
            .zip(&self.ends)
            .map(|(start, &end)| &self.entries[start..end])
    }

    /// Writes the next value of a row.
    #[inline]
    pub(super) fn put(&mut self, value: f32) {
        if value != 0.0 {
            self.entries.push((self.next, value));
        }
        self.next += 1;
    }

    /// Writes `length` zeros, with a 1 at each of these ascending places that is in range.
    #[inline]
    pub(super) fn put_ones(&mut self, places: impl IntoIterator<Item = usize>, length: usize) {
        let first = self.next;
        let places = places.into_iter().take_while(|place| *place < length);
        self.entries
            .extend(places.map(|place| (first + place as u32, 1.0)));
        self.next += length as u32;
    }

    /// Ends a row. Returns its length.
    pub(super) fn end_row(&mut self) -> usize {
        self.ends.push(self.entries.len());
        std::mem::take(&mut self.next) as usize
    }

    /// Appends rows of this length.
    pub(super) fn extend(&mut self, values: &[f32], length: usize) {
        for row in values.chunks_exact(length) {
            // Without a branch for each value, which would be mispredicted.
            let start = self.entries.len();
            self.entries.resize(start + length, (0, 0.0));
            let entries = &mut self.entries[start..];
            let mut used = 0;
            for (index, &value) in (0..).zip(row) {
                entries[used] = (index, value);
                used += usize::from(value != 0.0);
            }
            self.entries.truncate(start + used);
            self.ends.push(start + used);
        }
    }

    /// The rows with their zeros, each of this length, replacing the content of `out`.
    pub(super) fn write(&self, length: usize, out: &mut Vec<f32>) {
        out.clear();
        out.resize(self.len() * length, 0.0);
        for (row, out) in self.iter().zip(out.chunks_exact_mut(length)) {
            for &(index, value) in row {
                out[index as usize] = value;
            }
        }
    }
}
