//! Validated options of a vector environment.

use std::num::{NonZeroU32, NonZeroU64};
use std::sync::Arc;

use chefshat_engine::{ActionId, BySeat, Event, Game, RewardScheme, RuleSet, Seat, Seed};

use chefshat_agents::{AgentKind, Network};

use super::error::StateError;
use super::history::MAX_HISTORY;
use super::opponent::Opponent;
use super::saved::SavedGame;
use super::start::{Seeds, SetupError, Start, StartPoint};
use super::terms::{Decisions, InvalidActions, Terms};

/// The scope of an episode.
#[derive(Copy, Clone, Eq, PartialEq, Debug, Default)]
pub enum Episode {
    /// A Shift.
    #[default]
    Shift,
    /// A game.
    Game,
}

/// Options of a vector environment, created by [`VectorSetup::new`].
#[derive(Clone, Debug)]
pub struct VectorSetup {
    rules: RuleSet,
    games: u32,
    agents: BySeat<Option<Opponent>>,
    /// `trained`, then those that the client has supplied, each once.
    networks: Vec<Arc<Network>>,
    scheme: Option<RewardScheme>,
    episode: Episode,
    decisions: Decisions,
    skip_forced: bool,
    invalid: InvalidActions,
    total_games: Option<NonZeroU64>,
    seeds: Seeds,
    start: Start,
    statistics: bool,
    records: bool,
    history: u16,
    all_hands: bool,
}

/// Checks the numbers of games, seats and seeds.
fn check_sizes<A>(games: u32, agents: &BySeat<Option<A>>, seeds: &Seeds) -> Result<(), SetupError> {
    let seats = agents.values().filter(|agent| agent.is_none()).count();
    if seats == 0 {
        return Err(SetupError::NoClient);
    }
    if games == 0 {
        return Err(SetupError::NoGames);
    }
    if matches!(seeds, Seeds::List(list) if list.is_empty()) {
        return Err(SetupError::NoSeeds);
    }
    Ok(())
}

impl VectorSetup {
    /// Options for `games` parallel games with `agents` on the seats that the client does not play.
    /// By default there are no rewards, an episode is a Shift, the client takes all decisions, an
    /// illegal action is an error, and the number of games is unlimited.
    ///
    /// # Errors
    /// If the numbers of games or seats are out of range.
    pub fn new(
        rules: RuleSet,
        games: u32,
        agents: &[Option<AgentKind>],
        seeds: Seeds,
    ) -> Result<VectorSetup, SetupError> {
        let players = rules.players();
        let agents = BySeat::from_slice(agents)
            .filter(|agents| agents.len() == players)
            .ok_or(SetupError::Seats {
                given: agents.len(),
                players,
            })?;
        check_sizes(games, &agents, &seeds)?;
        Ok(VectorSetup {
            rules,
            games,
            agents: agents.map(|agent| agent.map(Opponent::BuiltIn)),
            networks: vec![Arc::clone(Network::trained())],
            scheme: None,
            episode: Episode::default(),
            decisions: Decisions::default(),
            skip_forced: false,
            invalid: InvalidActions::default(),
            total_games: None,
            seeds,
            start: Start::Deal,
            statistics: false,
            records: false,
            history: 0,
            all_hands: false,
        })
    }

    /// Has a network play a seat that the client does not.
    ///
    /// # Errors
    /// If the client plays the seat, or the network was trained for other games.
    pub fn with_network(
        mut self,
        seat: Seat,
        network: Arc<Network>,
    ) -> Result<VectorSetup, SetupError> {
        if self.agents.get(seat).is_none_or(Option::is_none) {
            return Err(SetupError::ClientsSeat(seat));
        }
        if !network.fits(&self.rules) {
            let info = network.info();
            return Err(SetupError::UnfitNetwork {
                trained: [info.players, info.faces, info.hand_size],
                here: [
                    self.rules.players() as u8,
                    self.rules.faces(),
                    self.rules.hand_size(),
                ],
            });
        }
        self.agents[seat] = Some(Opponent::Network(network.id()));
        if self.networks.iter().all(|known| known.id() != network.id()) {
            self.networks.push(network);
        }
        Ok(self)
    }

    /// Rewards turns by a scheme.
    pub fn with_rewards(self, scheme: Option<RewardScheme>) -> VectorSetup {
        VectorSetup { scheme, ..self }
    }

    /// Sets the scope of an episode.
    pub fn with_episode(self, episode: Episode) -> VectorSetup {
        VectorSetup { episode, ..self }
    }

    /// Sets which decisions the client takes.
    pub fn with_decisions(self, decisions: Decisions) -> VectorSetup {
        VectorSetup { decisions, ..self }
    }

    /// Sets whether decisions with one legal action are taken without asking.
    pub fn with_skip_forced(self, skip_forced: bool) -> VectorSetup {
        VectorSetup {
            skip_forced,
            ..self
        }
    }

    /// Sets how illegal actions are handled.
    pub fn with_invalid_actions(self, invalid: InvalidActions) -> VectorSetup {
        VectorSetup { invalid, ..self }
    }

    /// Sets the total number of games.
    ///
    /// # Errors
    /// If it is below the number of parallel games.
    pub fn with_total_games(self, total: Option<NonZeroU64>) -> Result<VectorSetup, SetupError> {
        match total {
            Some(total) if total.get() < u64::from(self.games) => Err(SetupError::Total {
                total: total.get(),
                games: self.games,
            }),
            total_games => Ok(VectorSetup {
                total_games,
                ..self
            }),
        }
    }

    /// Sets the seeds.
    pub fn with_seeds(self, seeds: Seeds) -> VectorSetup {
        VectorSetup { seeds, ..self }
    }

    /// Sets the start of each game. Saved games are checked with the options set before.
    ///
    /// # Errors
    /// If a script is invalid under the rule set, or a saved game cannot be continued: not with
    /// records, because the start of its game is unknown.
    pub fn with_start(self, mut start: Start) -> Result<VectorSetup, SetupError> {
        match &mut start {
            Start::Script(script) => {
                Game::scripted(self.rules, Seed([0; 32]), script, |_| {})?;
            }
            Start::Saved { games, .. } => {
                if games.is_empty() {
                    return Err(SetupError::NoSaved);
                }
                if self.records {
                    return Err(SetupError::SavedRecords);
                }
                let terms = self.terms();
                let mut games = Arc::make_mut(games).iter_mut().enumerate();
                games.try_for_each(|(entry, saved)| {
                    let error = |error| SetupError::Saved { entry, error };
                    saved.become_start(&terms).map_err(error)
                })?;
            }
            Start::Listed(points) => {
                if points.is_empty() {
                    return Err(SetupError::NoStarts);
                }
                let mut points = points.iter().enumerate();
                points.try_for_each(|(entry, point)| self.check_point(entry, point))?;
            }
            Start::Deal | Start::Point { .. } => {}
        }
        Ok(VectorSetup { start, ..self })
    }

    fn check_point(&self, entry: usize, point: &StartPoint) -> Result<(), SetupError> {
        let game = Game::scripted(self.rules, Seed([0; 32]), &point.script, |_| {});
        let mut game = game.map_err(|error| SetupError::ListedScript { entry, error })?;
        for (place, &action) in point.actions.iter().enumerate() {
            let mut ended = false;
            game.apply(action, |event| {
                ended |= matches!(event, Event::ShiftEnded(_))
            })
            .map_err(|error| SetupError::ListedAction {
                entry,
                place,
                error,
            })?;
            if ended {
                return Err(SetupError::ListedEnd { entry, place });
            }
        }
        Ok(())
    }

    /// Options for `times` copies of each of these games, otherwise the same. With seeds, copies
    /// differ in later deals and in the random choices of built-in agents; without, they continue
    /// as the saved games would. If the number of games is limited, none follows a copy; otherwise
    /// another copy does, which without seeds has the same deals again. Decisions are not kept for
    /// records.
    ///
    /// # Errors
    /// If there are no copies, or a game cannot be continued.
    pub fn forked(
        &self,
        games: Vec<SavedGame>,
        times: u32,
        seeds: Option<Seeds>,
    ) -> Result<VectorSetup, SetupError> {
        let copies = u32::try_from(games.len()).unwrap_or(u32::MAX);
        let copies = copies.saturating_mul(times);
        let same_deals = seeds.is_none();
        let seeds = seeds.unwrap_or_else(|| self.seeds.clone());
        check_sizes(copies, &self.agents, &seeds)?;
        VectorSetup {
            games: copies,
            seeds,
            total_games: self.total_games.and(NonZeroU64::new(copies.into())),
            records: false,
            start: Start::Deal,
            ..self.clone()
        }
        .with_history(self.history)?
        .with_start(Start::Saved {
            games: games.into(),
            same_deals,
        })
    }

    /// Sets whether batches contain the Shifts that ended.
    pub fn with_statistics(self, statistics: bool) -> VectorSetup {
        VectorSetup { statistics, ..self }
    }

    /// Sets the width of the history column: the latest actions of the Shift, as each seat may know
    /// them; 0 for none.
    ///
    /// # Errors
    /// If it is above [`MAX_HISTORY`].
    pub fn with_history(self, history: u16) -> Result<VectorSetup, SetupError> {
        if history > MAX_HISTORY {
            return Err(SetupError::History(history));
        }
        Ok(VectorSetup { history, ..self })
    }

    /// Sets whether batches have the hands of all seats.
    pub fn with_all_hands(self, all_hands: bool) -> VectorSetup {
        VectorSetup { all_hands, ..self }
    }

    /// Sets whether decisions are kept for records.
    pub fn with_records(self, records: bool) -> VectorSetup {
        VectorSetup { records, ..self }
    }

    /// The rule set.
    pub fn rules(&self) -> &RuleSet {
        &self.rules
    }

    /// Number of parallel games.
    pub fn games(&self) -> u32 {
        self.games
    }

    /// The agents by seat; `None` where the client plays.
    pub fn agents(&self) -> &BySeat<Option<Opponent>> {
        &self.agents
    }

    /// All agents: those of seats, and the one for decisions that the client does not take.
    pub fn built_in(&self) -> impl Iterator<Item = Opponent> + '_ {
        let others = match self.decisions {
            Decisions::Turns { others } => others,
            Decisions::All => None,
        };
        let agents = self.agents.values().copied();
        agents.chain([others.map(Opponent::BuiltIn)]).flatten()
    }

    /// Whether steps are long because of the agents: a network takes long for a decision, and an
    /// agent that may pass at any time for a Shift.
    pub fn has_slow_agents(&self) -> bool {
        self.built_in().any(|agent| match agent {
            Opponent::BuiltIn(kind) => {
                matches!(kind, AgentKind::Trained | AgentKind::RandomUnmasked)
            }
            Opponent::Network(_) => true,
        })
    }

    /// The network that takes the decisions of a seat which the client does not take, by its number.
    pub(super) fn network_at(&self, seat: Seat) -> Option<usize> {
        let agent = match (self.agents[seat], self.decisions) {
            (None, Decisions::Turns { others }) => others.map(Opponent::BuiltIn),
            (agent, _) => agent,
        };
        match agent? {
            Opponent::BuiltIn(AgentKind::Trained) => Some(0),
            Opponent::BuiltIn(_) => None,
            Opponent::Network(id) => self.networks.iter().position(|known| known.id() == id),
        }
    }

    /// A network, by its number.
    pub(super) fn network(&self, number: usize) -> &Network {
        &self.networks[number]
    }

    /// The seats of the client, ascending.
    pub fn client_seats(&self) -> impl Iterator<Item = Seat> + '_ {
        self.agents
            .iter()
            .filter(|(_, agent)| agent.is_none())
            .map(|(seat, _)| seat)
    }

    /// The reward scheme, if any.
    pub fn scheme(&self) -> Option<RewardScheme> {
        self.scheme
    }

    /// The scope of an episode.
    pub fn episode(&self) -> Episode {
        self.episode
    }

    /// Which decisions the client takes.
    pub fn decisions(&self) -> Decisions {
        self.decisions
    }

    /// Whether decisions with one legal action are taken without asking.
    pub fn skip_forced(&self) -> bool {
        self.skip_forced
    }

    /// How illegal actions are handled.
    pub fn invalid_actions(&self) -> InvalidActions {
        self.invalid
    }

    /// Invalid attempts at one decision after which the default decision is taken, for agents of
    /// any kind; `None` for no limit.
    pub(super) fn max_invalid_attempts(&self) -> Option<NonZeroU32> {
        match self.invalid {
            InvalidActions::AskAgain { limit } => limit,
            InvalidActions::Error => None,
        }
    }

    /// Whether batches contain the Shifts that ended.
    pub fn statistics(&self) -> bool {
        self.statistics
    }

    /// Whether decisions are kept for records.
    pub fn keeps_records(&self) -> bool {
        self.records
    }

    /// Width of the history column.
    pub fn history(&self) -> u16 {
        self.history
    }

    /// Games times the client's seats in each.
    pub fn seats_played(&self) -> u64 {
        u64::from(self.games) * self.client_seats().count() as u64
    }

    /// Whether batches have the hands of all seats.
    pub fn all_hands(&self) -> bool {
        self.all_hands
    }

    /// Width of the column of all hands.
    pub fn all_hands_width(&self) -> usize {
        let cards = usize::from(self.rules.faces()) + 1;
        usize::from(self.all_hands) * self.rules.players() * cards
    }

    /// The seeds of the games.
    pub fn seeds(&self) -> &Seeds {
        &self.seeds
    }

    /// Whether there is a game with this index.
    pub(super) fn has_game(&self, index: u64) -> bool {
        self.total_games.is_none_or(|total| index < total.get())
    }

    /// The seed of a game, by its index.
    pub fn game_seed(&self, index: u64) -> Seed {
        self.seeds.of(index)
    }

    /// What the state of a game depends on.
    pub(super) fn terms(&self) -> Terms {
        Terms {
            rules: self.rules,
            agents: self.agents,
            scheme: self.scheme,
            decisions: self.decisions,
            invalid: self.invalid,
            statistics: self.statistics,
            records: self.records,
            history: self.history,
        }
    }

    /// Checks that a saved game can continue with these options.
    pub(super) fn check(&self, saved: &SavedGame) -> Result<(), StateError> {
        saved.check(&self.terms())?;
        let copies = matches!(self.start, Start::Saved { .. });
        let start = |seed| self.begin(saved.index(), seed, |_, _, _| {});
        if self.records && !copies && !saved.is_played_from(start) {
            return Err(StateError::Record);
        }
        Ok(())
    }

    /// The start of each game.
    pub(super) fn start(&self) -> &Start {
        &self.start
    }

    /// The game with this index and seed at its start, which is not a saved one. Calls back with
    /// each action taken before, the game before it, and its events.
    pub(super) fn begin(
        &self,
        index: u64,
        seed: Seed,
        mut on_action: impl FnMut(&Game, ActionId, &[Event]),
    ) -> Game {
        let scripted = |script| {
            Game::scripted(self.rules, seed, script, |_| {})
                .expect("the script has been checked with these rules")
        };
        match &self.start {
            Start::Deal => Game::new(self.rules, seed, |_| {}),
            Start::Script(script) => scripted(script),
            Start::Listed(points) => {
                let point = &points[(index % points.len() as u64) as usize];
                let mut game = scripted(&point.script);
                let mut events = Vec::new();
                for &action in &point.actions {
                    let before = game.clone();
                    events.clear();
                    game.apply(action, |event| events.push(event))
                        .expect("the actions have been checked with these rules");
                    on_action(&before, action, &events);
                }
                game
            }
            Start::Point { game, same_deals } => {
                let mut game = Game::clone(game);
                if !same_deals {
                    game.reseed(seed);
                }
                game
            }
            Start::Saved { .. } => unreachable!("copies of saved games begin as they were saved"),
        }
    }
}
