//! Checks the revealed seed against the commitment of the header, and finds the seed of each
//! Shift.

use chefshat_engine::{MAX_ENTROPY, Seed, SeedPlan};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};

use super::difference::must_be;

/// Decisions taken over from another record, with the seed of the Shifts dealt in them.
#[derive(Debug, Clone)]
pub(super) struct Part {
    pub(super) decisions: u64,
    seed: Seed,
}

impl Part {
    /// `None` if the seed does not have 32 bytes.
    pub(super) fn new(part: &v1::TakenOver) -> Option<Self> {
        Some(Self {
            decisions: part.decisions,
            seed: Seed(part.game_seed.as_slice().try_into().ok()?),
        })
    }
}

/// The seeds of a game: those taken over, then its own.
#[derive(Debug)]
pub(super) struct Seeds {
    pub(super) taken_over: Vec<Part>,
    pub(super) own: Seed,
}

impl Seeds {
    /// The seed of a Shift that starts after `decisions`. The first Shift is dealt from the first
    /// part, even if it has no decisions.
    pub(super) fn after(&self, decisions: u64) -> Seed {
        let mut end = 0u64;
        self.taken_over
            .iter()
            .find(|part| {
                end = end.saturating_add(part.decisions);
                decisions < end || decisions == 0
            })
            .map_or(self.own, |part| part.seed)
    }
}

/// The seed reveal of a line that ends the game.
pub(crate) fn reveal(line: &v1::RecordLine) -> Option<&v1::SeedReveal> {
    match line.line.as_ref()? {
        Line::Event(event) => match event.kind.as_ref()? {
            Kind::GameEnded(ended) => ended.reveal.as_ref(),
            Kind::GameAborted(aborted) => aborted.reveal.as_ref(),
            _ => None,
        },
        _ => None,
    }
}

/// The seed to deal from. If the reveal does not match the commitment, its game seed is used: the
/// deals are then checked first, and the reveal is rejected on its own line.
pub(super) fn dealing_seed(
    header: &v1::RecordHeader,
    game_id: &[u8; 16],
    reveal: &v1::SeedReveal,
) -> Option<Seed> {
    plan(header, game_id, reveal)
        .and_then(|plan| {
            plan.map_or(revealed(reveal), |plan| {
                Ok(plan.game_seed(&reveal.seat_entropy))
            })
        })
        .or_else(|_| revealed(reveal))
        .ok()
}

/// Checks a reveal against the header of its record.
pub(super) fn check_reveal(
    header: &v1::RecordHeader,
    game_id: &[u8; 16],
    reveal: &v1::SeedReveal,
) -> Result<(), String> {
    let seed = revealed(reveal)?;
    match plan(header, game_id, reveal)? {
        Some(plan) if plan.game_seed(&reveal.seat_entropy) != seed => Err(must_be(
            "reveal.gameSeed (hexadecimal)",
            hex::encode(seed.0),
            hex::encode(plan.game_seed(&reveal.seat_entropy).0),
        )),
        Some(_) => Ok(()),
        None => {
            let others = [
                ("serverSeed", reveal.server_seed.is_empty()),
                ("nonce", reveal.nonce.is_empty()),
                ("seatEntropy", reveal.seat_entropy.is_empty()),
            ];
            match others.iter().find(|(_, empty)| !empty) {
                Some((field, _)) => Err(format!(
                    "reveal.{field} is present, but the header has no seedCommitment"
                )),
                None => Ok(()),
            }
        }
    }
}

/// The committed seed plan, checked; `None` for a fixed seed.
fn plan(
    header: &v1::RecordHeader,
    game_id: &[u8; 16],
    reveal: &v1::SeedReveal,
) -> Result<Option<SeedPlan>, String> {
    if header.seed_commitment.is_empty() {
        return Ok(None);
    }
    let plan = SeedPlan::Committed {
        server_seed: bytes("serverSeed", &reveal.server_seed)?,
        nonce: bytes("nonce", &reveal.nonce)?,
    };
    if reveal.seat_entropy.len() != header.seats.len() {
        return Err(format!(
            "reveal.seatEntropy has {} entries and must have {}, one per seat",
            reveal.seat_entropy.len(),
            header.seats.len()
        ));
    }
    if reveal
        .seat_entropy
        .iter()
        .any(|part| part.len() > MAX_ENTROPY)
    {
        return Err(format!(
            "reveal.seatEntropy has an entry of more than {MAX_ENTROPY} bytes"
        ));
    }
    let commitment = plan.commitment(game_id).map(Vec::from);
    if commitment.as_ref() != Some(&header.seed_commitment) {
        return Err(format!(
            "reveal.serverSeed and reveal.nonce do not match the commitment: seedCommitment is {} and they give {} \
             (hexadecimal)",
            hex::encode(&header.seed_commitment),
            hex::encode(commitment.unwrap_or_default())
        ));
    }
    Ok(Some(plan))
}

fn revealed(reveal: &v1::SeedReveal) -> Result<Seed, String> {
    bytes("gameSeed", &reveal.game_seed).map(Seed)
}

fn bytes(field: &str, bytes: &[u8]) -> Result<[u8; 32], String> {
    bytes
        .try_into()
        .map_err(|_| format!("reveal.{field} has {} bytes and must have 32", bytes.len()))
}
