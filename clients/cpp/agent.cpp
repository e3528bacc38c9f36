// An agent without an SDK: it joins a room or a tournament and takes a random legal action at every
// decision. It contains no rules of the game. It reconnects after a lost connection; with its
// ticket another process can resume its seat. It runs on Linux and other Unix systems.

#include <fcntl.h>
#include <grpcpp/grpcpp.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <iterator>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "chefshat/v1/play_service.grpc.pb.h"
#include "chefshat/v1/room_service.grpc.pb.h"
#include "chefshat/v1/tournament_service.grpc.pb.h"

namespace {

namespace v1 = chefshat::v1;
using std::chrono::milliseconds;

// Maximum number of games that a participant of a tournament plays at a time.
constexpr uint32_t MAX_GAMES = 64;
// Maximum number of consecutive connections without progress: about ten minutes.
constexpr int MAX_CONNECTIONS = 120;
// Maximum number of attempts to join.
constexpr int MAX_JOINS = 4;
// Maximum duration of an attempt to connect, and how often it checks whether the agent stops.
constexpr milliseconds CONNECT_TIME{5000};
constexpr milliseconds CHECK_INTERVAL{100};
// Maximum pause after a call or a stream that failed.
constexpr milliseconds MAX_PAUSE{5000};
// Maximum duration of an attempt to join.
constexpr std::chrono::seconds JOIN_TIME{30};

// An error for the person who started the agent.
struct Failure : std::runtime_error {
  using std::runtime_error::runtime_error;
};

using Random = std::mt19937_64;

// Chooses an action, the index of a set bit of the mask. Change this to play better:
// `request.observation()` is what the seat knows.
uint32_t choose(const v1::DecisionRequest& request, Random& random) {
  const std::string& mask = request.action_mask();
  std::vector<uint32_t> legal;
  for (uint32_t action = 0; action < mask.size() * 8; ++action) {
    const auto byte = static_cast<unsigned char>(mask[action / 8]);
    if ((byte >> (action % 8)) & 1) legal.push_back(action);
  }
  if (legal.empty()) return request.default_action();
  return legal[std::uniform_int_distribution<size_t>(0, legal.size() - 1)(random)];
}

// Stops the agent when it receives SIGINT or SIGTERM: cancels its call, or ends its pause.
class Stop {
 public:
  // Call before any thread is started: all of them inherit the blocked signals.
  Stop() {
    sigemptyset(&signals_);
    sigaddset(&signals_, SIGINT);
    sigaddset(&signals_, SIGTERM);
    pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
    waiting_ = std::thread([this] {
      int signal = 0;
      sigwait(&signals_, &signal);
      request();
    });
  }

  Stop(const Stop&) = delete;
  Stop& operator=(const Stop&) = delete;

  ~Stop() {
    pthread_kill(waiting_.native_handle(), SIGTERM);  // Ends the thread.
    waiting_.join();
  }

  // The call to cancel from now on, or none.
  void watch(grpc::ClientContext* call) {
    const std::lock_guard lock(mutex_);
    call_ = call;
    if (call_ != nullptr && stopping_) call_->TryCancel();
  }

  // Waits. Throws a `Failure` if the agent stops.
  void pause(milliseconds duration) {
    std::unique_lock lock(mutex_);
    requested_.wait_for(lock, duration, [this] { return stopping_; });
    check();
  }

  // Throws a `Failure` if the agent stops.
  void check_requested() {
    const std::lock_guard lock(mutex_);
    check();
  }

 private:
  void request() {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    if (call_ != nullptr) call_->TryCancel();
    requested_.notify_all();
  }

  void check() const {
    if (stopping_) throw Failure("stopped by a signal");
  }

  sigset_t signals_;
  std::thread waiting_;
  std::mutex mutex_;
  std::condition_variable requested_;
  bool stopping_ = false;
  grpc::ClientContext* call_ = nullptr;
};

// What the command line says, with defaults from the environment.
struct Options {
  std::string address = "127.0.0.1:50051";
  std::string code;
  std::string tournament;
  std::string games = "1";
  std::string name = "C++";
  std::string ticket;
  std::string ticket_file;
  std::string token;
  std::string ca;
  std::string seed;
};

constexpr const char* USAGE =
    "usage: agent [--address HOST:PORT|https://HOST:PORT] [--token TOKEN] [--ca FILE] [--seed N]\n"
    "             (--code CODE | --tournament CODE [--games N]) [--name NAME] "
    "[--ticket-file FILE]\n"
    "       agent ... --ticket TICKET\n"
    "Environment: CHEFSHAT_CODE, CHEFSHAT_TICKET, CHEFSHAT_TOKEN, CHEFSHAT_CA";

std::string environment(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

// Parses a number from 1 to `max`.
uint64_t number(const std::string& flag, const std::string& text, uint64_t max) {
  const bool digits = !text.empty() && text.size() < 20 &&
                      text.find_first_not_of("0123456789") == std::string::npos;
  const uint64_t value = digits ? std::stoull(text) : 0;
  if (value >= 1 && value <= max) return value;
  throw Failure(flag + " must be a number from 1 to " + std::to_string(max));
}

Options parse(const std::vector<std::string>& arguments) {
  Options options;
  const std::map<std::string, std::string*> flags{
      {"--address", &options.address}, {"--code", &options.code},
      {"--games", &options.games},     {"--tournament", &options.tournament},
      {"--name", &options.name},       {"--ticket-file", &options.ticket_file},
      {"--token", &options.token},     {"--ticket", &options.ticket},
      {"--seed", &options.seed},       {"--ca", &options.ca},
  };
  options.token = environment("CHEFSHAT_TOKEN");
  options.ca = environment("CHEFSHAT_CA");
  options.ticket = environment("CHEFSHAT_TICKET");
  for (size_t i = 0; i < arguments.size(); i += 2) {
    const auto flag = flags.find(arguments[i]);
    if (flag == flags.end()) throw Failure("unknown argument " + arguments[i] + "\n" + USAGE);
    if (i + 1 == arguments.size()) throw Failure(arguments[i] + " needs a value\n" + USAGE);
    *flag->second = arguments[i + 1];
  }
  const int ways = !options.code.empty() + !options.tournament.empty() + !options.ticket.empty();
  if (ways > 1 || (!options.ticket.empty() && !options.ticket_file.empty())) {
    throw Failure(
        "give one of --code, --tournament and --ticket (or CHEFSHAT_TICKET); "
        "--ticket-file excludes --ticket");
  }
  if (ways == 0) options.code = environment("CHEFSHAT_CODE");
  return options;
}

std::string trimmed(const std::string& text) {
  const char* spaces = " \t\r\n";
  const size_t first = text.find_first_not_of(spaces);
  if (first == std::string::npos) return "";
  return text.substr(first, text.find_last_not_of(spaces) - first + 1);
}

std::string contents(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw Failure("cannot read " + path);
  return {std::istreambuf_iterator<char>(file), {}};
}

// A server, and the token that every call to it needs.
struct Server {
  std::shared_ptr<grpc::Channel> channel;
  std::string token;
};

// Waits until there is a connection. The blocking interface of gRPC connects only in calls like
// this one: during a pause, nothing would happen. Throws a `Failure` if the agent stops.
grpc::Status connected(const Server& server, Stop& stop) {
  const auto now = std::chrono::system_clock::now;
  for (const auto end = now() + CONNECT_TIME; now() < end;) {
    stop.check_requested();
    if (server.channel->WaitForConnected(now() + CHECK_INTERVAL)) return grpc::Status::OK;
  }
  return {grpc::StatusCode::UNAVAILABLE, "no connection to the server"};
}

bool is_this_machine(const std::string& target) {
  return target.starts_with("localhost:") || target.starts_with("127.") ||
         target.starts_with("[::1]:") || target.starts_with("unix:");
}

grpc::ChannelArguments channel_arguments() {
  grpc::ChannelArguments arguments;
  // Finds a dead connection before a decision is lost. Without the last of these only two pings are
  // sent while the stream is silent.
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 3000);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 5000);
  arguments.SetInt(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  // Short: the pauses between connections are the agent's own.
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 100);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 1000);
  return arguments;
}

// Opens a channel: to host:port or http:// in plain text, to https:// with TLS.
Server connect(const Options& options) {
  const bool tls = options.address.starts_with("https://");
  const size_t scheme = options.address.find("://");
  std::string target = options.address.substr(scheme == std::string::npos ? 0 : scheme + 3);
  while (target.ends_with('/')) target.pop_back();
  auto credentials = grpc::InsecureChannelCredentials();
  if (tls) {
    grpc::SslCredentialsOptions trust;
    if (!options.ca.empty()) trust.pem_root_certs = contents(options.ca);
    credentials = grpc::SslCredentials(trust);
  } else if (!options.token.empty() && !is_this_machine(target)) {
    std::cerr << "warning: the token is sent unencrypted; use https://" << target << std::endl;
  }
  return {grpc::CreateCustomChannel(target, credentials, channel_arguments()),
          trimmed(options.token)};
}

// One call, which ends early if the agent stops.
class Call {
 public:
  Call(const Server& server, Stop& stop) : stop_(stop) {
    if (!server.token.empty()) context.AddMetadata("authorization", "Bearer " + server.token);
    stop_.watch(&context);
  }

  Call(const Call&) = delete;
  Call& operator=(const Call&) = delete;

  ~Call() { stop_.watch(nullptr); }

  grpc::ClientContext context;

 private:
  Stop& stop_;
};

// Whether repeating a call that ended with this code is useless.
bool is_final(grpc::StatusCode code) {
  switch (code) {
    case grpc::StatusCode::INVALID_ARGUMENT:
    case grpc::StatusCode::NOT_FOUND:
    case grpc::StatusCode::ALREADY_EXISTS:
    case grpc::StatusCode::PERMISSION_DENIED:
    case grpc::StatusCode::FAILED_PRECONDITION:
    case grpc::StatusCode::OUT_OF_RANGE:
    case grpc::StatusCode::UNIMPLEMENTED:
    case grpc::StatusCode::UNAUTHENTICATED:
      return true;
    default:
      return false;
  }
}

// The pause after this many failures, with jitter, so that agents do not return all at once.
milliseconds pause_after(int failures) {
  const milliseconds pause = std::min(MAX_PAUSE, milliseconds(50) * (1 << std::min(failures, 7)));
  std::random_device device;
  return milliseconds(std::uniform_int_distribution(pause.count() / 2, pause.count())(device));
}

// 32 bytes that nobody can guess.
std::string random_bytes() {
  std::random_device device;
  std::string bytes(32, '\0');
  for (char& byte : bytes) byte = static_cast<char>(device());
  return bytes;
}

// Joins a room or a tournament. Returns the ticket. An attempt whose response is lost is repeated
// with the same request id, so that it takes no second seat.
class Joining {
 public:
  Joining(const Server& server, Stop& stop) : server_(server), stop_(stop) {}

  std::string room(const Options& options) {
    v1::JoinRoomRequest request;
    request.set_join_code(options.code);
    request.set_name(options.name);
    request.set_kind(v1::PARTICIPANT_KIND_AGENT);
    request.set_request_id(random_bytes());
    const auto stub = v1::RoomService::NewStub(server_.channel);
    return repeated<v1::JoinRoomResponse>([&](auto* context, auto* response) {
             return stub->JoinRoom(context, request, response);
           })
        .ticket();
  }

  std::string tournament(const Options& options) {
    v1::JoinTournamentRequest request;
    request.set_join_code(options.tournament);
    request.set_name(options.name);
    request.set_kind(v1::PARTICIPANT_KIND_AGENT);
    const uint64_t games = number("--games", options.games, MAX_GAMES);
    request.set_max_games(static_cast<uint32_t>(games));
    request.set_request_id(random_bytes());
    const auto stub = v1::TournamentService::NewStub(server_.channel);
    return repeated<v1::JoinTournamentResponse>([&](auto* context, auto* response) {
             return stub->JoinTournament(context, request, response);
           })
        .ticket();
  }

 private:
  template <class Response, class Method>
  Response repeated(Method&& method) {
    for (int failures = 1;; ++failures) {
      Response response;
      grpc::Status status = connected(server_, stop_);
      if (status.ok()) {
        Call call(server_, stop_);
        call.context.set_deadline(std::chrono::system_clock::now() + JOIN_TIME);
        status = method(&call.context, &response);
      }
      if (status.ok()) return response;
      stop_.check_requested();
      if (failures == MAX_JOINS || is_final(status.error_code())) {
        throw Failure(status.error_message());
      }
      stop_.pause(pause_after(failures));
    }
  }

  const Server& server_;
  Stop& stop_;
};

// A seat of a game.
struct Seat {
  std::string ticket;
  std::string game_id;
  uint32_t number = 0;
  bool attached = false;
  // The number of the next event.
  uint64_t next_event = 0;
  // The decision that was requested last.
  v1::DecisionRequest request;
  // The last answer, until its result arrives.
  std::optional<v1::Answer> unacknowledged;
  // How the game ended.
  std::optional<v1::GameEnded> result;
  std::optional<v1::GameAborted> abort;
};

// How a game ended for its seat: with standings, or with an error.
struct Outcome {
  std::string game_id;
  uint32_t seat = 0;
  std::optional<v1::GameEnded> result;
  std::string error;
  // Whether the game is over, so that nobody needs the ticket any more.
  bool over = false;
};

// How the agent's room or tournament ended.
struct Played {
  std::optional<uint32_t> participant;
  std::vector<Outcome> outcomes;
};

// Plays with the ticket of a seat, or of a participant of a tournament with all its seats, until
// the game or the tournament is over.
class Player {
 public:
  Player(const Server& server, Stop& stop, Random& random)
      : server_(server),
        stop_(stop),
        random_(random),
        stub_(v1::PlayService::NewStub(server.channel)) {}

  Played play(const std::string& ticket) {
    ticket_ = ticket;
    add_seat(ticket);
    for (failures_ = 1; failures_ <= MAX_CONNECTIONS; ++failures_) {
      lost_ = connected(server_, stop_);
      if (!lost_.ok()) continue;
      lost_ = connection();
      if (is_over()) return played_;
      stop_.check_requested();
      if (is_final(lost_.error_code())) throw Failure(lost_.error_message());
      stop_.pause(pause_after(failures_));
    }
    throw Failure("no connection for a long time: " + lost_.error_message());
  }

 private:
  using Stream = grpc::ClientReaderWriter<v1::PlayRequest, v1::PlayResponse>;

  // Attaches all seats on a new stream and plays until it ends. Returns its status.
  grpc::Status connection() {
    Call call(server_, stop_);
    const auto stream = stub_->Play(&call.context);
    stream->Write(attach_all());
    v1::PlayResponse response;
    while (!is_over() && !reconnect_ && stream->Read(&response)) {
      commands_.Clear();
      for (const v1::SeatUpdate& update : response.updates()) receive(update);
      if (commands_.commands_size() > 0) stream->Write(commands_);
    }
    if (is_over()) stream->WritesDone();
    if (reconnect_) call.context.TryCancel();
    while (stream->Read(&response)) {
    }
    return stream->Finish();
  }

  // Handles number the attachments of the client, from 0; the server adds further ones.
  v1::PlayRequest attach_all() {
    v1::PlayRequest request;
    by_handle_.clear();
    entered_.reset();
    reconnect_ = false;
    uint32_t handle = 0;
    for (auto& [ticket, seat] : seats_) {
      v1::Attach* attach = request.add_commands()->mutable_attach();
      attach->set_ticket(ticket);
      attach->set_from_sequence(seat.next_event);
      seat.attached = false;
      by_handle_[handle++] = &seat;
    }
    if (in_tournament_) {  // Last, so that the server does not attach its seats again.
      request.add_commands()->mutable_attach()->set_ticket(ticket_);
      entered_ = handle;
    }
    return request;
  }

  bool is_over() const { return seats_.empty() && !in_tournament_; }

  // Updates of unknown kinds, and of seats whose game is over, are ignored.
  void receive(const v1::SeatUpdate& update) {
    if (update.has_entered()) return enter(update.handle(), update.entered());
    if (update.has_attached() && !update.attached().ticket().empty()) {
      by_handle_[update.handle()] = &add_seat(update.attached().ticket());
    }
    if (entered_ == update.handle()) return receive_as_participant(update);
    const auto seat = by_handle_.find(update.handle());
    if (seat != by_handle_.end()) receive(*seat->second, update);
  }

  void receive(Seat& seat, const v1::SeatUpdate& update) {
    switch (update.update_case()) {
      case v1::SeatUpdate::kAttached:
        failures_ = 0;
        seat.attached = true;
        seat.number = update.attached().seat();
        seat.game_id = update.attached().game_id();
        break;
      case v1::SeatUpdate::kEvents:
        for (const auto& event : update.events().events()) observe(seat, update.handle(), event);
        break;
      case v1::SeatUpdate::kSnapshot:  // Stands for events that the room no longer has.
        seat.next_event = std::max(seat.next_event, update.snapshot().next_sequence());
        break;
      case v1::SeatUpdate::kSubstitution:
        if (update.substitution().active()) command(update.handle()).mutable_resume();
        break;
      case v1::SeatUpdate::kDecision:
        decide(seat, update.handle(), update.decision());
        break;
      case v1::SeatUpdate::kResult:
        acknowledge(seat, update.handle(), update.result());
        break;
      case v1::SeatUpdate::kRefused:
        refuse(seat, update.refused());
        break;
      case v1::SeatUpdate::kDetached:
        detach(seat, update.handle(), update.detached().reason());
        break;
      default:
        break;
    }
  }

  void observe(Seat& seat, uint32_t handle, const v1::GameEvent& event) {
    if (event.sequence() < seat.next_event) return;
    seat.next_event = event.sequence() + 1;
    if (event.has_game_ended()) seat.result = event.game_ended();
    if (event.has_game_aborted()) seat.abort = event.game_aborted();
    const bool substituted = event.has_substituted() && event.substituted().seat() == seat.number;
    if (substituted && !event.substituted().for_good()) command(handle).mutable_resume();
  }

  // A decision that is requested again after a lost connection gets the same answer: the server may
  // have accepted it already.
  void decide(Seat& seat, uint32_t handle, const v1::DecisionRequest& request) {
    const bool again =
        seat.unacknowledged && seat.unacknowledged->decision_id() == request.decision_id();
    const uint32_t action = again ? seat.unacknowledged->action() : choose(request, random_);
    seat.request = request;
    answer(seat, handle, action);
  }

  // After INVALID the decision is still open and is not requested again.
  void acknowledge(Seat& seat, uint32_t handle, const v1::AnswerResult& result) {
    if (result.decision_id() != seat.request.decision_id()) return;
    seat.unacknowledged.reset();
    if (result.status() != v1::ANSWER_STATUS_INVALID) return;
    const bool closed = result.has_invalid_attempts_left() && result.invalid_attempts_left() == 0;
    if (!closed) answer(seat, handle, seat.request.default_action());
  }

  void answer(Seat& seat, uint32_t handle, uint32_t action) {
    v1::Answer& answer = *command(handle).mutable_answer();
    answer.set_decision_id(seat.request.decision_id());
    answer.set_action(action);
    seat.unacknowledged = answer;
  }

  v1::SeatCommand& command(uint32_t handle) {
    v1::SeatCommand& command = *commands_.add_commands();
    command.set_handle(handle);
    return command;
  }

  // A refusal of another command than Attach means that this stream is of no use for the seat.
  void refuse(Seat& seat, const v1::Refused& refused) {
    if (seat.attached || !is_final(static_cast<grpc::StatusCode>(refused.code()))) {
      reconnect_ = true;
    } else {
      finish(seat, "refused: " + refused.message() + " (" + refused.reason() + ")", false);
    }
  }

  void detach(Seat& seat, uint32_t handle, v1::DetachReason reason) {
    by_handle_.erase(handle);
    if (reason == v1::DETACH_REASON_SERVER_STOPPING) return;  // The end of the stream follows.
    if (reason != v1::DETACH_REASON_GAME_OVER) {
      finish(seat, "the seat is lost (" + v1::DetachReason_Name(reason) + ")", false);
    } else if (!seat.result) {
      const auto why = seat.abort ? seat.abort->reason() : v1::ABORT_REASON_UNSPECIFIED;
      finish(seat, "the game has no result (" + v1::AbortReason_Name(why) + ")", true);
    } else {
      finish(seat, "", true);
    }
  }

  // The ticket is that of a participant, not of a seat.
  void enter(uint32_t handle, const v1::Entered& entered) {
    if (!in_tournament_) remove_seat(ticket_);
    failures_ = 0;
    in_tournament_ = true;
    entered_ = handle;
    played_.participant = entered.participant();
  }

  void receive_as_participant(const v1::SeatUpdate& update) {
    if (update.has_refused()) {
      if (is_final(static_cast<grpc::StatusCode>(update.refused().code()))) {
        throw Failure("refused: " + update.refused().message());
      }
      reconnect_ = true;
    }
    if (!update.has_detached()) return;
    const v1::DetachReason reason = update.detached().reason();
    if (reason == v1::DETACH_REASON_SERVER_STOPPING) return;
    if (reason != v1::DETACH_REASON_TOURNAMENT_OVER) {
      throw Failure("the tournament is lost (" + v1::DetachReason_Name(reason) + ")");
    }
    in_tournament_ = false;
  }

  Seat& add_seat(const std::string& ticket) {
    Seat& seat = seats_[ticket];
    seat.ticket = ticket;
    return seat;
  }

  void finish(Seat& seat, const std::string& error, bool over) {
    played_.outcomes.push_back({seat.game_id, seat.number, seat.result, error, over});
    remove_seat(std::string(seat.ticket));
  }

  void remove_seat(const std::string& ticket) {
    std::erase_if(by_handle_, [&](const auto& entry) { return entry.second->ticket == ticket; });
    seats_.erase(ticket);
  }

  const Server& server_;
  Stop& stop_;
  Random& random_;
  std::unique_ptr<v1::PlayService::Stub> stub_;
  // The ticket that was given or that joining returned.
  std::string ticket_;
  // Whether it is that of a participant whose tournament is not over.
  bool in_tournament_ = false;
  // Seats whose game is not over, by their tickets.
  std::map<std::string, Seat> seats_;
  // Of this stream: its seats by handle, the handle of the participant, commands to be sent, and
  // whether to leave it for another one.
  std::map<uint32_t, Seat*> by_handle_;
  std::optional<uint32_t> entered_;
  v1::PlayRequest commands_;
  bool reconnect_ = false;
  // Consecutive connections without progress, and how the last one ended.
  int failures_ = 0;
  grpc::Status lost_;
  Played played_;
};

// A file that contains the ticket from joining until the game is over, so that the same command
// resumes after a crash. Readable only by its owner, and locked: a second agent is refused.
class TicketFile {
 public:
  explicit TicketFile(const std::string& path) : path_(path) {
    if (path_.empty()) return;
    struct stat about = {};
    do {  // Again if the agent that has just ended removed the file before it was locked.
      close();
      file_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, S_IRUSR | S_IWUSR);
      if (file_ < 0) throw Failure("cannot open " + path_ + ": " + std::strerror(errno));
      if (::flock(file_, LOCK_EX | LOCK_NB) != 0) throw Failure("another agent uses " + path_);
      if (::fstat(file_, &about) != 0) throw Failure("cannot read " + path_);
    } while (about.st_nlink == 0);
    ticket_ = trimmed(contents(path_));
  }

  TicketFile(const TicketFile&) = delete;
  TicketFile& operator=(const TicketFile&) = delete;

  ~TicketFile() {
    if (file_ >= 0 && ticket_.empty()) ::unlink(path_.c_str());  // Joining failed.
    close();
  }

  const std::string& ticket() const { return ticket_; }

  // Stores a new ticket. Returns false if there is no file, or it cannot be written.
  bool store(const std::string& ticket) {
    if (file_ < 0) return false;
    const std::string line = ticket + "\n";
    const auto written = ::pwrite(file_, line.data(), line.size(), 0);
    if (written != static_cast<ssize_t>(line.size()) || ::fsync(file_) != 0) {
      std::cerr << "warning: cannot store the ticket: " << std::strerror(errno) << std::endl;
      return false;
    }
    ticket_ = ticket;
    return true;
  }

  // Removes the file, because its ticket is used up.
  void forget() { ticket_.clear(); }

 private:
  void close() {
    if (file_ >= 0) ::close(file_);
    file_ = -1;
  }

  std::string path_;
  int file_ = -1;
  std::string ticket_;
};

// The ticket that is given or stored, or a new one.
std::string ticket_of(const Options& options, TicketFile& file, Joining joining) {
  if (!options.ticket.empty()) return options.ticket;
  if (!file.ticket().empty()) {
    std::cerr << "resuming with the ticket in " << options.ticket_file << std::endl;
    return file.ticket();
  }
  if (options.code.empty() && options.tournament.empty()) {
    throw Failure(std::string("give --code, --tournament or --ticket\n") + USAGE);
  }
  const std::string ticket =
      options.tournament.empty() ? joining.room(options) : joining.tournament(options);
  const bool stored = file.store(ticket);
  std::cerr << "if this process ends early, resume "
            << (stored ? "by the same command: the ticket is in " + options.ticket_file
                       : "with --ticket " + ticket)
            << std::endl;
  return ticket;
}

void print_outcome(std::ostream& out, const Outcome& outcome, bool with_game) {
  out << "{";
  if (with_game) out << "\"game_id\":" << std::quoted(outcome.game_id) << ",";
  out << "\"seat\":" << outcome.seat;
  if (!outcome.error.empty()) {
    out << ",\"error\":" << std::quoted(outcome.error) << "}";
    return;
  }
  out << ",\"standings\":[";
  const char* separator = "";
  for (const v1::Standing& line : outcome.result->standings()) {
    out << separator << "{\"seat\":" << line.seat() << ",\"points\":" << line.points()
        << ",\"place\":" << line.place() << "}";
    separator = ",";
  }
  out << "]}";
}

// Prints the outcome of a game, or of all games of a tournament, as a line of JSON.
void print(std::ostream& out, const Played& played) {
  if (!played.participant) {
    print_outcome(out, played.outcomes.front(), false);
  } else {
    out << "{\"participant\":" << *played.participant << ",\"games\":[";
    const char* separator = "";
    for (const Outcome& outcome : played.outcomes) {
      out << separator;
      print_outcome(out, outcome, true);
      separator = ",";
    }
    out << "]}";
  }
  out << std::endl;
}

// The random numbers of the decisions: the same for the same seed.
Random random_of(const Options& options) {
  if (options.seed.empty()) return Random(std::random_device{}());
  return Random(number("--seed", options.seed, UINT32_MAX));
}

void run(const Options& options) {
  Stop stop;
  const Server server = connect(options);
  Random random = random_of(options);
  TicketFile file(options.ticket_file);
  const std::string ticket = ticket_of(options, file, Joining(server, stop));
  const Played played = Player(server, stop, random).play(ticket);
  const Outcome* only = played.participant ? nullptr : &played.outcomes.front();
  if (only == nullptr || only->over) file.forget();
  if (only != nullptr && !only->error.empty()) throw Failure(only->error);
  print(std::cout, played);
}

}  // namespace

int main(int count, char** arguments) {
  try {
    run(parse({arguments + 1, arguments + count}));
    return EXIT_SUCCESS;
  } catch (const Failure& failure) {
    std::cerr << "agent: " << failure.what() << std::endl;
    return EXIT_FAILURE;
  }
}
