//! `chefshat study test`: test participants who go through a study as people do, by the calls that the
//! page makes. They answer by chance, and a built-in agent plays their games.

use std::collections::BTreeMap;
use std::process::ExitCode;
use std::time::Duration;

use chefshat_agents::NamedAgent;
use chefshat_client::{Client, Connection};
use chefshat_proto::v1::{
    self, participation_service_client::ParticipationServiceClient, study_item_answer::Value,
    study_shown_item::Kind, study_view::Content,
};
use clap::Args;
use futures::future;
use futures::stream::{self, StreamExt as _};
use rand::rngs::StdRng;
use rand::{RngExt as _, SeedableRng as _};
use serde_json::json;
use tokio::sync::watch;
use tokio_util::task::AbortOnDropHandle;
use tonic::{Status, Streaming};

use super::connection::{get_study, refused, service};
use super::owner::{Owned, line};
use crate::numbers::counted;
use crate::remote::{RemoteAgent, named_agent, seed_for};
use crate::{CommandError, progress, say};

/// Let test participants go through a study: it tries every stage and condition, and gives data to
/// try an analysis with. Neither counts nor exported data of others include them.
#[derive(Debug, Args)]
#[command(
    after_help = "Games with seats for programs of yours wait for these: let them run meanwhile. Built-in agents take their time: in a copy of the study with `policy = { pace_ms = 0 }` they do not."
)]
pub(super) struct Test {
    #[command(flatten)]
    owned: Owned,
    /// Number of test participants to add, at most 1000; by default 8, or as many more as make whole groups.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000))]
    participants: Option<u32>,
    /// How many of them take part at the same time, at most 32.
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=32))]
    at_once: u32,
    /// The built-in agent that plays their games.
    #[arg(long, default_value = "random", value_parser = named_agent)]
    agent: NamedAgent,
    /// Seed of their answers and of the agent.
    #[arg(long)]
    seed: Option<u64>,
}

impl Test {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let owned = &self.owned;
        let mut researcher = service(&owned.server).await?;
        let (study_id, owner_token) = (owned.study_id.clone(), owned.owner.token()?);
        let shown = get_study(&researcher, &study_id, &owner_token).await?;
        let settings = shown.study.and_then(|it| it.settings);
        let size = (settings.and_then(|it| it.groups)).map_or(1, |groups| groups.size.max(1));
        let wanted = self.participants.unwrap_or(8);
        let whole = wanted.next_multiple_of(size);
        if self.participants.is_some() && wanted != whole {
            let problem = format!("{wanted} is not a multiple of {size}, the size of groups");
            return Err(format!("--participants: {problem}").into());
        }
        let request = v1::AddStudyParticipantsRequest {
            study_id: study_id.clone(),
            owner_token: owner_token.clone(),
            count: whole,
            test: true,
            ..v1::AddStudyParticipantsRequest::default()
        };
        let added = researcher.add_study_participants(request).await;
        let links = added.map_err(refused)?.into_inner().links;
        let numbers: Vec<u32> = links.iter().map(|link| link.number).collect();

        // Those of a group wait for each other.
        let at_once = self.at_once.next_multiple_of(size) as usize;
        let problems = self.take_part(links, at_once).await?;
        let shown = get_study(&researcher, &study_id, &owner_token).await?;
        let mut participants = shown.participants;
        participants.retain(|it| numbers.contains(&it.number));
        let count = |state| participants.iter().filter(|it| it.state() == state).count();
        let completed = count(v1::StudyParticipantState::Completed);
        let screened_out = count(v1::StudyParticipantState::ScreenedOut);
        let left_over = count(v1::StudyParticipantState::LeftOver);
        let games = participants.iter().flat_map(|it| &it.games);
        let aborted = games.filter(|it| it.ended() == v1::RoomState::Aborted);
        let aborted = aborted.count();
        if owned.json {
            say(json!({
                "event": "tested", "completed": completed, "screened_out": screened_out,
                "left_over": left_over,
                "games_without_result": aborted,
                "participants": participants, "problems": problems,
            }))?;
        } else {
            participants.iter().try_for_each(|it| say(line(it)))?;
            for (name, problem) in &problems {
                say(format_args!("{name}: {problem}"))?;
            }
            let all = counted(whole.into(), "test participant");
            say(format_args!("{completed} of {all} completed the study"))?;
            if screened_out > 0 {
                let out = counted(screened_out.try_into()?, "test participant");
                say(format_args!("{out} screened out"))?;
            }
            if left_over > 0 {
                let left_over = counted(left_over.try_into()?, "test participant");
                say(format_args!("{left_over} left over without a group"))?;
            }
            if aborted > 0 {
                let games = counted(aborted.try_into()?, "game");
                say(format_args!("{games} ended without a result"))?;
            }
        }
        let all_ended = completed + screened_out == numbers.len() && aborted == 0;
        Ok(match all_ended && completed > 0 {
            true => ExitCode::SUCCESS,
            false => ExitCode::FAILURE,
        })
    }

    /// Lets those with these links take part. Returns the problems of those who could not, by
    /// pseudonym.
    async fn take_part(
        &self,
        links: Vec<v1::StudyLink>,
        at_once: usize,
    ) -> Result<BTreeMap<String, String>, CommandError> {
        let client = self.owned.server.connect().await?;
        let count = links.len();
        let bar = progress::of_items(count.try_into()?, "test participants");
        let (coming, _) = watch::channel(count);
        let taking_part = links.into_iter().enumerate().map(|(index, link)| {
            let seed = seed_for(&format!("test participant {index}"), self.seed);
            let tester = Tester {
                client: client.clone(),
                service: ParticipationServiceClient::new(client.channel()),
                agent: self.agent,
                chance: StdRng::from_seed(seed),
                session: String::new(),
                coming: Some(Coming(coming.clone())),
            };
            let bar = &bar;
            async move {
                let mut service = tester.service.clone();
                let ended = tester.take_part(link.link.clone()).await;
                bar.inc(1);
                let problem = ended.err()?;
                // Its game is closed, and nobody waits for it.
                let request = v1::WithdrawFromStudyRequest {
                    link: link.link,
                    delete_data: false,
                };
                let _ = service.withdraw_from_study(request).await;
                Some((link.pseudonym, problem.to_string()))
            }
        });
        let taking_part = stream::iter(taking_part).buffer_unordered(at_once);
        let problems = taking_part.filter_map(future::ready).collect().await;
        bar.finish_and_clear();
        Ok(problems)
    }
}

/// A test participant.
struct Tester {
    client: Client,
    service: ParticipationServiceClient<Connection>,
    agent: NamedAgent,
    chance: StdRng,
    session: String,
    /// Until it has arrived.
    coming: Option<Coming>,
}

/// One of those who have not arrived where people wait for their groups, which counts them.
struct Coming(watch::Sender<usize>);

impl Drop for Coming {
    fn drop(&mut self) {
        self.0.send_modify(|count| *count -= 1);
    }
}

impl Tester {
    /// Does what the study asks for, to its end.
    async fn take_part(mut self, link: String) -> Result<(), CommandError> {
        let request = v1::OpenStudyRequest { link, device: None };
        let opened = self.service.open_study(request).await.map_err(refused)?;
        let opened = opened.into_inner();
        self.session = opened.session;
        let mut view = opened.view.unwrap_or_default();
        let request = v1::FollowParticipationRequest {
            session: self.session.clone(),
        };
        // While it is open, the participant counts as present.
        let followed = self.service.follow_participation(request).await;
        let mut views = Views::of(followed.map_err(refused)?.into_inner());
        let mut played = String::new();
        loop {
            let step = view.step;
            let next = match view.content {
                Some(Content::End(_)) => return Ok(()),
                Some(Content::Consent(_)) => self.consent(step).await,
                Some(Content::Questionnaire(shown)) => self.answer(step, &shown.items).await,
                Some(Content::Game(game)) if !game.ended => {
                    if !game.ticket.is_empty() && game.ticket != played {
                        let agent = self.agent();
                        self.client.play(game.ticket.clone(), agent).await?;
                        played = game.ticket;
                    }
                    // Its room, or its end, comes on the stream.
                    views.next(step).await
                }
                Some(Content::Arrival(_)) => self.arrive(step, &mut views).await,
                Some(_) => self.proceed(step).await,
                None => views.next(step).await,
            };
            view = next.map_err(refused)?;
        }
    }

    /// Waits for its group, unless nobody comes any more: then it continues alone.
    async fn arrive(&mut self, step: u32, views: &mut Views) -> Result<v1::StudyView, Status> {
        let Some(arrived) = self.coming.take() else {
            return views.after(step).await;
        };
        let mut coming = arrived.0.subscribe();
        drop(arrived);
        tokio::select! {
            view = views.after(step) => view,
            _ = coming.wait_for(|count| *count == 0) => match self.proceed(step).await {
                // Its group was formed meanwhile.
                Err(_) => views.after(step).await,
                continued => continued,
            },
        }
    }

    fn agent(&mut self) -> RemoteAgent {
        RemoteAgent::named(self.agent, self.chance.random(), Duration::ZERO)
    }

    async fn consent(&mut self, step: u32) -> Result<v1::StudyView, Status> {
        let session = self.session.clone();
        let request = v1::GiveConsentRequest { session, step };
        let answer = self.service.give_consent(request).await;
        answer.map(|it| it.into_inner().view.unwrap_or_default())
    }

    async fn answer(
        &mut self,
        step: u32,
        items: &[v1::StudyShownItem],
    ) -> Result<v1::StudyView, Status> {
        let request = v1::AnswerQuestionnaireRequest {
            session: self.session.clone(),
            step,
            answers: answers(items, &mut self.chance),
        };
        let answer = self.service.answer_questionnaire(request).await;
        answer.map(|it| it.into_inner().view.unwrap_or_default())
    }

    async fn proceed(&mut self, step: u32) -> Result<v1::StudyView, Status> {
        let session = self.session.clone();
        let request = v1::ContinueStudyRequest { session, step };
        let answer = self.service.continue_study(request).await;
        answer.map(|it| it.into_inner().view.unwrap_or_default())
    }
}

/// The newest view of a stream, which is read to its end: what waits in it would hold up other answers.
struct Views {
    newest: watch::Receiver<Option<Result<v1::StudyView, Status>>>,
    _reading: AbortOnDropHandle<()>,
}

impl Views {
    fn of(mut stream: Streaming<v1::FollowParticipationResponse>) -> Self {
        let (sender, newest) = watch::channel(None);
        let reading = tokio::spawn(async move {
            while let Some(next) = stream.message().await.transpose() {
                // A heartbeat has no view.
                if let Some(next) = next.map(|next| next.view).transpose() {
                    sender.send_replace(Some(next));
                }
            }
        });
        Self {
            newest,
            _reading: AbortOnDropHandle::new(reading),
        }
    }

    /// The next view of a later step.
    async fn after(&mut self, step: u32) -> Result<v1::StudyView, Status> {
        self.next(step.saturating_add(1)).await
    }

    /// The next view that is not of an earlier step.
    async fn next(&mut self, step: u32) -> Result<v1::StudyView, Status> {
        loop {
            let changed = self.newest.changed().await;
            changed.map_err(|_| Status::unavailable("the server has ended the stream"))?;
            let newest = self.newest.borrow_and_update().clone();
            match newest.transpose()? {
                Some(view) if view.step >= step => return Ok(view),
                _ => {}
            }
        }
    }
}

/// Valid answers by chance to the items that these answers show. One in two of the optional ones has
/// none.
fn answers(items: &[v1::StudyShownItem], chance: &mut StdRng) -> Vec<v1::StudyItemAnswer> {
    let mut answers: Vec<v1::StudyItemAnswer> = Vec::new();
    for item in items {
        let is_shown = item.shown_if.iter().all(|condition| {
            let answer = answers.iter().find(|answer| answer.item == condition.item);
            let answer = answer.and_then(|answer| answer.value.as_ref());
            let is_one = answer.zip(condition.answers.as_ref());
            is_one.is_some_and(|(value, set)| is_among(value, set)) != condition.not
        });
        if !is_shown || (item.optional && chance.random()) {
            continue;
        }
        answers.push(v1::StudyItemAnswer {
            item: item.item,
            value: item.kind.as_ref().map(|kind| value(kind, chance)),
            answered_after_ms: None,
        });
    }
    answers
}

/// Whether an answer is one of these, or has one of these options.
fn is_among(value: &Value, answers: &v1::StudyAnswerSet) -> bool {
    match value {
        Value::Number(number) => {
            answers.min.is_none_or(|min| min <= *number)
                && answers.max.is_none_or(|max| *number <= max)
        }
        Value::Options(chosen) => {
            let mut chosen = chosen.options.iter();
            chosen.any(|option| answers.options.contains(option))
        }
        Value::Text(_) => false,
    }
}

/// A valid answer by chance.
fn value(kind: &Kind, chance: &mut StdRng) -> Value {
    let mut within = |min: i32, max: i32| chance.random_range(min..=max.max(min));
    match kind {
        Kind::Likert(v1::StudyLikert { points, .. })
        | Kind::SemanticDifferential(v1::StudySemanticDifferential { points, .. }) => {
            Value::Number(within(1, i32::try_from(*points).unwrap_or(1)))
        }
        Kind::Slider(slider) => {
            let step = i32::try_from(slider.step.max(1)).unwrap_or(i32::MAX);
            let steps = slider.max.saturating_sub(slider.min) / step;
            Value::Number(slider.min + step * within(0, steps))
        }
        Kind::Number(number) => Value::Number(within(number.min, number.max)),
        Kind::Choice(choice) => {
            let last = i32::try_from(choice.options.len()).unwrap_or(1) - 1;
            let (one, other) = (within(0, last), within(0, last));
            let mut options = vec![one.unsigned_abs()];
            if choice.multiple && other > one {
                options.push(other.unsigned_abs());
            }
            Value::Options(v1::StudyChosen { options })
        }
        Kind::FreeText(text) => {
            let words = "An answer of a test participant.".chars();
            Value::Text(words.take(text.max_characters as usize).collect())
        }
    }
}
