//! A hand sorted into stacks of one face, rarest first, jokers last.

/// Cards of one hand.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Hand {
    /// Counts: index f-1 for face f, the last one for jokers.
    pub counts: Vec<u8>,
    /// Contains the Golden card.
    pub golden: bool,
}

/// The cards of one face, or the jokers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stack {
    /// The face; F+1 for jokers.
    pub face: u32,
    /// How many cards.
    pub count: u8,
    /// Whether it is a joker.
    pub joker: bool,
    /// Contains the Golden card.
    pub golden: bool,
}

impl Hand {
    /// Makes a hand of cards (F+1 for a joker); cards outside the deck are ignored.
    pub fn of(faces: usize, cards: &[u32], golden: bool) -> Self {
        let mut hand = Self {
            counts: vec![0; faces + 1],
            golden,
        };
        hand.put(cards);
        hand
    }

    /// Adds cards, by their faces.
    pub fn put(&mut self, cards: &[u32]) {
        for card in cards {
            self.add(*card, 1);
        }
    }

    /// Adds cards of a face.
    pub fn add(&mut self, face: u32, quantity: u32) {
        let quantity = u8::try_from(quantity).unwrap_or(u8::MAX);
        if let Some(count) = self.slot(face) {
            *count = count.saturating_add(quantity);
        }
    }

    /// Removes cards of a face.
    pub fn take(&mut self, face: u32, quantity: u32) {
        let quantity = u8::try_from(quantity).unwrap_or(u8::MAX);
        if let Some(count) = self.slot(face) {
            *count = count.saturating_sub(quantity);
        }
    }

    fn slot(&mut self, face: u32) -> Option<&mut u8> {
        let index = usize::try_from(face).ok()?.checked_sub(1)?;
        self.counts.get_mut(index)
    }

    /// Its stacks, rarest first, jokers last.
    pub fn stacks(&self) -> Vec<Stack> {
        let faces = self.counts.len().saturating_sub(1);
        (0..)
            .zip(&self.counts)
            .filter(|(_, count)| **count > 0)
            .map(|(index, &count)| Stack {
                face: u32::try_from(index + 1).unwrap_or(u32::MAX),
                count,
                joker: index == faces,
                golden: self.golden && index + 1 == faces,
            })
            .collect()
    }

    /// Number of jokers.
    pub fn jokers(&self) -> u8 {
        self.counts.last().copied().unwrap_or(0)
    }
}
