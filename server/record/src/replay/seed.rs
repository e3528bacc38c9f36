//! What a record reveals of its seed at its end, against what its header committed to, and which seed dealt which Shift.

use chefshat_engine::Seed;
use chefshat_proto::v1;

use super::header::check_id;
use super::words::must_be;
use chefshat_engine::{MAX_ENTROPY, SeedPlan};

/// Decisions taken over from another record, and the seed of the Shifts dealt among them.
#[derive(Debug, Clone)]
pub(super) struct Part {
    pub(super) decisions: u64,
    seed: Seed,
}

impl Part {
    /// `None` if the seed is not one.
    pub(super) fn new(part: &v1::TakenOver) -> Option<Self> {
        Some(Self {
            decisions: part.decisions,
            seed: Seed(part.game_seed.as_slice().try_into().ok()?),
        })
    }
}

/// The seeds of a game: those taken over, and its own after them.
#[derive(Debug)]
pub(super) struct Seeds {
    pub(super) taken_over: Vec<Part>,
    pub(super) own: Seed,
}

impl Seeds {
    /// The seed of a Shift that begins after so many decisions. The first Shift is dealt from the first part, even if no decision of it was
    /// taken over.
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

/// The seed to deal from. If the parts of a commitment are not whole, the game seed as revealed must do: the deals then show whether that
/// is right, and the reveal's own line is refused in any case.
pub(super) fn dealing_seed(header: &v1::RecordHeader, reveal: &v1::SeedReveal) -> Option<Seed> {
    plan(header, reveal)
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
    reveal: &v1::SeedReveal,
) -> Result<(), String> {
    let seed = revealed(reveal)?;
    match plan(header, reveal)? {
        Some(plan) if plan.game_seed(&reveal.seat_entropy) != seed => Err(must_be(
            "reveal.gameSeed (in hexadecimal)",
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
                    "reveal.{field} is there, but the header has no seedCommitment"
                )),
                None => Ok(()),
            }
        }
    }
}

/// The plan that header and reveal tell of, its commitment checked; `None` for a fixed seed.
fn plan(header: &v1::RecordHeader, reveal: &v1::SeedReveal) -> Result<Option<SeedPlan>, String> {
    if header.seed_commitment.is_empty() {
        return Ok(None);
    }
    let plan = SeedPlan::Committed {
        server_seed: bytes("serverSeed", &reveal.server_seed)?,
        nonce: bytes("nonce", &reveal.nonce)?,
    };
    if reveal.seat_entropy.len() != header.seats.len() {
        return Err(format!(
            "reveal.seatEntropy has {} entries and must have one for each of the {} seats",
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
            "reveal.seatEntropy: a seat added more than {MAX_ENTROPY} bytes"
        ));
    }
    let game_id = check_id("gameId", &header.game_id)?;
    let commitment = plan.commitment(&game_id).map(Vec::from);
    if commitment.as_ref() != Some(&header.seed_commitment) {
        return Err(format!(
            "serverSeed and nonce of the reveal are not what was committed to: the header's seedCommitment is {} and they give {} \
             (in hexadecimal)",
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
