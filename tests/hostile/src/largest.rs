//! The largest messages that a server accepts: studies, games of vector streams, and imports, each
//! of which an attacker repeats until its share is used up. Those that are refused are in `acts`.

use std::time::Duration;

use bytes::Bytes;
use chefshat_proto::v1::{
    self, record_line::Line, record_service_client::RecordServiceClient,
    vector_service_client::VectorServiceClient,
};
use prost::Message as _;
use tokio::task::JoinSet;
use tokio::time::{sleep, sleep_until, timeout_at};
use tokio_stream::StreamExt as _;
use tonic::Status;

use crate::acts::{self, LARGE_AT_ONCE};
use crate::bodies::framed;
use crate::raw::RawRequest;
use crate::target::{Target, newest_record};

/// Questionnaires of the largest study, items of each and options of each item: nearly 20,000
/// elements, with which the message is nearly 1 MiB long.
const QUESTIONNAIRES: u32 = 4;
const ITEMS: u32 = 94;
const OPTIONS: u32 = 50;
const OPTION_BYTES: usize = 48;
/// Games of a vector stream: the most seats that a remote caller may have.
const GAMES: u32 = 4_096;
/// Listed starts of a vector stream: their message is nearly 9 MiB once it is decoded.
const STARTS: u32 = 5_000;
/// Pause before a stream that was refused is opened again.
const AGAIN_AFTER: Duration = Duration::from_millis(50);
/// Bytes of a record that is imported: the most that its memory allows.
const RECORD_BYTES: usize = 40 * 1024 * 1024;
/// Bytes of the lines in one message of an import.
const PART_BYTES: usize = 56 * 1024;

/// Creates the largest studies, many at once.
pub(crate) async fn studies(target: &Target) {
    let body = framed(&study(target.count(ITEMS)).encode_to_vec());
    let request = RawRequest::grpc("StudyService/CreateStudy", vec![body]);
    target
        .send_all(1, LARGE_AT_ONCE, u32::MAX, move |_| request.clone())
        .await;
}

/// A study whose questionnaires have this number of items each.
fn study(items: u32) -> v1::CreateStudyRequest {
    use v1::{study_item::Kind, study_stage::Stage};
    let option = |number| format!("{number:0>OPTION_BYTES$}");
    let item = |number| v1::StudyItem {
        id: format!("i{number}"),
        text: "?".into(),
        kind: Some(Kind::Choice(v1::StudyChoice {
            options: (0..OPTIONS).map(option).collect(),
            multiple: true,
        })),
        ..v1::StudyItem::default()
    };
    let questionnaires = (0..QUESTIONNAIRES).map(|number| v1::StudyStage {
        stage: Some(Stage::Questionnaire(v1::StudyQuestionnaire {
            id: format!("q{number}"),
            items: (0..items).map(item).collect(),
            ..v1::StudyQuestionnaire::default()
        })),
        ..v1::StudyStage::default()
    });
    let mut request = acts::study();
    if let Some(settings) = &mut request.settings {
        settings.stages.splice(0..1, questionnaires);
    }
    request
}

/// Opens streams of as many games as one may have, many at once, and holds them.
pub(crate) async fn vectors(target: &Target) -> Result<(), Status> {
    let connection = target.connection().await?;
    let setup = v1::RunRequest {
        request: Some(v1::run_request::Request::Setup(Box::new(setup(
            target.count(GAMES),
            target.count(STARTS),
        )))),
    };
    let mut streams = JoinSet::new();
    for _ in 0..LARGE_AT_ONCE {
        let (target, setup) = (target.clone(), setup.clone());
        let mut service =
            VectorServiceClient::new(connection.clone()).max_decoding_message_size(usize::MAX);
        streams.spawn(async move {
            loop {
                target.tally.tried(1);
                let sent = tokio_stream::once(setup.clone()).chain(tokio_stream::pending());
                let opened = async {
                    let mut answers = service.run(sent).await?.into_inner();
                    // What was accepted, and the first batch.
                    answers.message().await?;
                    answers.message().await?;
                    Ok::<_, Status>(answers)
                };
                let opened = opened.await;
                target.tally.outcome(&opened);
                if let Ok(_held) = opened {
                    return sleep_until(target.until).await;
                }
                sleep(AGAIN_AFTER).await;
            }
        });
    }
    let _ = timeout_at(target.until, streams.join_all()).await;
    Ok(())
}

/// Games that begin with listed hands.
fn setup(games: u32, starts: u32) -> v1::VectorSetup {
    // One card of the face 1, two of the face 2, up to eleven, and two jokers, in four hands.
    let faces = (1..=11).flat_map(|face| std::iter::repeat_n(face, face as usize));
    let deck: Vec<u32> = faces.chain([12, 12]).collect();
    let hands = (0..).zip(deck.chunks(deck.len() / 4));
    let hands = hands.map(|(seat, cards)| v1::SeatCards {
        seat,
        cards: cards.to_vec(),
        golden: cards.contains(&11),
    });
    let start = v1::ListedStart {
        hands: Some(v1::ScriptedShift {
            hands: hands.collect(),
            ..v1::ScriptedShift::default()
        }),
        ..v1::ListedStart::default()
    };
    v1::VectorSetup {
        games,
        seeds: Some(v1::vector_setup::Seeds::BaseSeed(1)),
        start: Some(v1::vector_setup::Start::Listed(v1::ListedStarts {
            starts: vec![start; starts as usize],
        })),
        reward_scheme: v1::RewardScheme::Paper.into(),
        ..v1::VectorSetup::default()
    }
}

/// Imports a record again and again, each time with another id, many at once.
pub(crate) async fn imports(target: &Target) -> Result<(), Status> {
    let mut records = RecordServiceClient::new(target.connection().await?);
    let game_id = newest_record(&mut records, "hostile").await?;
    let mut answers = records
        .get_record(v1::GetRecordRequest { game_id })
        .await?
        .into_inner();
    let mut lines = Vec::new();
    while let Some(answer) = answers.message().await? {
        lines.extend(answer.lines);
    }
    let (header, parts) = parts(lines, RECORD_BYTES / target.divide as usize);
    let request = move |_| {
        let mut header = header.clone();
        if let Some(Line::Header(header)) = &mut header.line {
            header.game_id = format!("{:032x}", rand::random::<u128>());
        }
        let first = v1::ImportRecordRequest {
            lines: vec![header],
        };
        let mut body = vec![framed(&first.encode_to_vec())];
        body.extend(parts.iter().cloned());
        RawRequest::grpc("RecordService/ImportRecord", body)
    };
    // A connection each: those that wait would hold up the one that is received.
    (target.send_all(LARGE_AT_ONCE as u32, 1, u32::MAX, request)).await;
    Ok(())
}

/// The header of a record, and the messages of its other lines, whose decisions are annotated until
/// they have this many bytes.
fn parts(lines: Vec<v1::RecordLine>, bytes: usize) -> (v1::RecordLine, Vec<Bytes>) {
    let mut lines = lines.into_iter();
    let header = lines.next().unwrap_or_default();
    let mut parts = Vec::new();
    let (mut part, mut in_part, mut in_all) = (v1::ImportRecordRequest::default(), 0, 0);
    for mut line in lines {
        match &mut line.line {
            Some(Line::Decision(decision)) if in_all < bytes => {
                decision.annotations = Some(acts::annotations(acts::ANNOTATION_BYTES));
            }
            Some(Line::Footer(footer)) => footer.signature = None,
            _ => {}
        }
        let length = line.encoded_len();
        if in_part + length > PART_BYTES {
            parts.push(framed(&std::mem::take(&mut part).encode_to_vec()));
            in_part = 0;
        }
        in_part += length;
        in_all += length;
        part.lines.push(line);
    }
    parts.push(framed(&part.encode_to_vec()));
    (header, parts)
}

#[cfg(test)]
mod tests {
    use chefshat_proto::cost::{Cost, Method};

    use super::*;

    #[test]
    fn the_largest_messages_are_nearly_as_large_as_legal() {
        let cost = |call: &str, message: Vec<u8>| {
            let method = Method::find(&format!("/chefshat.v1.{call}")).expect("a call");
            let cost = method.request.cost(&message, Cost::MAX).expect("readable");
            (message.len(), cost)
        };
        let (bytes, taken) = cost("StudyService/CreateStudy", study(ITEMS).encode_to_vec());
        assert!((900 * 1024..=1024 * 1024).contains(&bytes), "{bytes}");
        assert!((19_000..=20_000).contains(&taken.elements), "{taken:?}");
        let setup = v1::RunRequest {
            request: Some(v1::run_request::Request::Setup(Box::new(setup(
                GAMES, STARTS,
            )))),
        };
        let (bytes, taken) = cost("VectorService/Run", setup.encode_to_vec());
        assert!(bytes <= 1024 * 1024, "{bytes}");
        assert!(
            (8 << 20..=9 << 20).contains(&taken.memory),
            "{bytes} {taken:?}"
        );
    }
}
