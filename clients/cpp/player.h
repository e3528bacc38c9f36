// What the protocol requires of an agent: calls that are repeated, and a stream that is opened
// again after a lost connection, with all seats of a room or of a tournament.
#pragma once

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <functional>
#include <iostream>
#include <iterator>
#include <list>
#include <optional>
#include <random>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>

#include "chefshat/v1/play_service.grpc.pb.h"

namespace v1 = chefshat::v1;

// An error for the person who started the agent.
using Failure = std::runtime_error;

// A call that failed with one of these codes would fail again.
inline const std::set<uint32_t> FINAL{
    grpc::INVALID_ARGUMENT,    grpc::NOT_FOUND,    grpc::ALREADY_EXISTS, grpc::PERMISSION_DENIED,
    grpc::FAILED_PRECONDITION, grpc::OUT_OF_RANGE, grpc::UNIMPLEMENTED,  grpc::UNAUTHENTICATED};

// A server, and the token that every call to it needs.
struct Server {
  // The address is host:port, or https:// for TLS. `authorities` is a PEM file of the certificate
  // authorities to trust instead of the system's, or empty. The token may be empty.
  Server(const std::string& address, const std::string& given_token,
         const std::string& authorities) {
    std::istringstream(given_token) >> token;  // Without spaces around it.
    const size_t scheme = address.find("://");
    std::string target = address.substr(scheme == std::string::npos ? 0 : scheme + 3);
    if (target.ends_with('/')) target.pop_back();
    auto credentials = grpc::InsecureChannelCredentials();
    if (address.starts_with("https://")) {
      grpc::SslCredentialsOptions trust;
      std::ifstream file(authorities);
      if (!authorities.empty() && !file) throw Failure("cannot read " + authorities);
      trust.pem_root_certs.assign(std::istreambuf_iterator<char>(file), {});
      credentials = grpc::SslCredentials(trust);
    } else if (!token.empty() && !target.starts_with("localhost:") && !target.starts_with("127.")) {
      std::cerr << "warning: the token is sent unencrypted; use https://" << target << std::endl;
    }
    grpc::ChannelArguments arguments;
    // Finds a dead connection before a decision is lost. Newer versions of gRPC wait a minute for
    // the answer to a ping without the third of these; without the last, only two pings are sent
    // while the stream is silent.
    arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 3000);
    arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 5000);
    arguments.SetInt("grpc.http2.ping_timeout_ms", 5000);
    arguments.SetInt(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
    // Short, because `call` pauses too.
    arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 1000);
    channel = grpc::CreateCustomChannel(target, credentials, arguments);
  }

  // Calls until the status is OK. The pauses before the attempts grow, with jitter, so that agents
  // do not return all at once. The blocking interface of gRPC connects only in `WaitForConnected`.
  void call(int attempts, const std::function<grpc::Status(grpc::ClientContext*)>& method) const {
    using std::chrono::milliseconds;
    std::random_device random;
    for (int failures = 0;;) {
      const unsigned pause = std::min(5000, 50 << std::min(failures, 7));
      std::this_thread::sleep_for(milliseconds(pause / 2 + random() % (pause / 2)));
      grpc::Status status(grpc::UNAVAILABLE, "no connection to the server");
      if (channel->WaitForConnected(std::chrono::system_clock::now() + milliseconds(2000))) {
        grpc::ClientContext context;
        if (!token.empty()) context.AddMetadata("authorization", "Bearer " + token);
        status = method(&context);
      }
      if (status.ok()) return;
      if (++failures == attempts || FINAL.contains(status.error_code())) {
        throw Failure(status.error_message());
      }
    }
  }

  std::shared_ptr<grpc::Channel> channel;
  std::string token;
};

// A seat; or the participant of a tournament, whose seats the server adds.
struct Seat {
  std::string ticket;
  // Its number on this stream.
  uint32_t handle = 0;
  std::string game_id;
  // Its number in the game.
  uint32_t number = 0;
  uint64_t next_event = 0;
  // The answer to the last decision, and an action that is certainly legal.
  v1::Answer answer;
  uint32_t default_action = 0;
  // Whether the game is over, with a result or without.
  bool over = false;
  v1::GameEnded result;
  // Why there is no result; empty if there is one.
  std::string error = "the game has no result";
};

// Plays with a ticket until the game, or the tournament with all its games, is over.
class Player {
 public:
  // Returns the index of an action.
  using Choose = std::function<uint32_t(const v1::DecisionRequest&)>;

  Player(const Server& server, const Choose& choose, const std::string& ticket)
      : server_(server), choose_(choose), ticket_(ticket) {
    seats_.emplace_back().ticket = ticket;
  }

  // Throws a `Failure` if the ticket is refused or lost, or the server is away for long.
  void play() {
    while (!seats_.empty()) {
      server_.call(MAX_CONNECTIONS, [this](auto* context) { return play_on_stream(context); });
    }
  }

  // The seats whose games are over.
  const std::list<Seat>& finished() const { return finished_; }
  // The number of the participant; none outside of tournaments.
  std::optional<uint32_t> participant() const { return participant_; }

 private:
  // Consecutive connections without progress: about ten minutes.
  static constexpr int MAX_CONNECTIONS = 120;
  using SeatIterator = std::list<Seat>::iterator;

  // Attaches all seats and plays until the stream ends. Returns OK if there was progress: a stream
  // begins with the state, so only what follows its first message counts.
  grpc::Status play_on_stream(grpc::ClientContext* context) {
    const auto stub = v1::PlayService::NewStub(server_.channel);
    const auto stream = stub->Play(context);
    commands_.Clear();
    uint32_t handle = 0;
    for (Seat& seat : seats_) {
      seat.handle = handle++;
      v1::Attach& attach = *commands_.add_commands()->mutable_attach();
      attach.set_ticket(seat.ticket);
      attach.set_from_sequence(seat.next_event);
    }
    stream->Write(commands_);
    v1::PlayResponse response;
    refused_ = grpc::Status::OK;
    int messages = 0;
    while (!seats_.empty() && refused_.ok() && stream->Read(&response)) {
      ++messages;
      commands_.Clear();
      for (const v1::SeatUpdate& update : response.updates()) receive(update);
      if (commands_.commands_size() > 0) stream->Write(commands_);
    }
    stream->WritesDone();
    while (stream->Read(&response)) {
    }
    const grpc::Status end = stream->Finish();
    if (messages > 1 || seats_.empty() || !refused_.ok()) return refused_;
    return end.ok() ? grpc::Status(grpc::UNAVAILABLE, "the server ended the stream") : end;
  }

  // An update has one of these contents, or one of a newer server.
  void receive(const v1::SeatUpdate& update) {
    const std::string& ticket = update.attached().ticket();  // Of a seat that the server adds.
    auto seat = std::find_if(seats_.begin(), seats_.end(), [&](const Seat& it) {
      return ticket.empty() ? it.handle == update.handle() : it.ticket == ticket;
    });
    if (seat == seats_.end()) {
      if (ticket.empty()) return;  // Its game is over.
      if (is_over(update.attached().game_id())) {
        command(update.handle()).mutable_detach();
        return;
      }
      // First: the participant attaches last, so that the server does not add these seats again.
      seat = seats_.emplace(seats_.begin());
      seat->ticket = ticket;
    }
    if (update.has_entered()) participant_ = update.entered().participant();
    if (update.has_attached()) {
      seat->handle = update.handle();
      seat->game_id = update.attached().game_id();
      seat->number = update.attached().seat();
    }
    for (const v1::GameEvent& event : update.events().events()) observe(*seat, event);
    // A snapshot stands for events that the room no longer has.
    seat->next_event = std::max(seat->next_event, update.snapshot().next_sequence());
    if (update.substitution().active()) command(seat->handle).mutable_resume();
    if (update.has_decision()) decide(*seat, update.decision());
    if (update.has_result()) acknowledge(*seat, update.result());
    if (update.has_refused()) refuse(seat, update.refused());
    if (update.has_detached()) detach(seat, update.detached().reason());
  }

  // A game that ended just before the connection was lost may not have been counted yet.
  bool is_over(const std::string& game_id) const {
    return std::any_of(finished_.begin(), finished_.end(),
                       [&](const Seat& seat) { return seat.over && seat.game_id == game_id; });
  }

  void observe(Seat& seat, const v1::GameEvent& event) {
    seat.next_event = event.sequence() + 1;
    if (event.has_substituted() && event.substituted().seat() == seat.number) {
      command(seat.handle).mutable_resume();
    }
    seat.over |= event.has_game_ended() || event.has_game_aborted();
    if (event.has_game_aborted()) {
      seat.error += " (" + v1::AbortReason_Name(event.game_aborted().reason()) + ")";
    }
    if (event.has_game_ended()) {
      seat.result = event.game_ended();
      seat.error.clear();
    }
  }

  // A decision that is requested again after a lost connection gets the same answer: the server may
  // have accepted it already.
  void decide(Seat& seat, const v1::DecisionRequest& request) {
    if (seat.answer.decision_id() != request.decision_id()) {
      seat.answer.set_decision_id(request.decision_id());
      seat.answer.set_action(choose_(request));
    }
    seat.default_action = request.default_action();
    *command(seat.handle).mutable_answer() = seat.answer;
  }

  // After INVALID the decision is still open and is not requested again.
  void acknowledge(Seat& seat, const v1::AnswerResult& result) {
    if (result.status() != v1::ANSWER_STATUS_INVALID) return;
    if (result.decision_id() != seat.answer.decision_id()) return;
    seat.answer.set_action(seat.default_action);
    *command(seat.handle).mutable_answer() = seat.answer;
  }

  v1::SeatCommand& command(uint32_t handle) {
    v1::SeatCommand& command = *commands_.add_commands();
    command.set_handle(handle);
    return command;
  }

  void refuse(SeatIterator seat, const v1::Refused& refused) {
    if (FINAL.contains(refused.code())) {
      lose(seat, "refused: " + refused.message() + " (" + refused.reason() + ")");
    } else {
      refused_ = grpc::Status(grpc::UNAVAILABLE, refused.message());
    }
  }

  void detach(SeatIterator seat, v1::DetachReason reason) {
    if (reason == v1::DETACH_REASON_SERVER_STOPPING) return;  // The end of the stream follows.
    if (reason == v1::DETACH_REASON_TOURNAMENT_OVER) {
      seats_.erase(seat);
    } else if (reason == v1::DETACH_REASON_GAME_OVER) {
      finished_.splice(finished_.end(), seats_, seat);
    } else {
      lose(seat, "the seat is lost (" + v1::DetachReason_Name(reason) + ")");
    }
  }

  // A tournament continues without a seat that the server had added. The ticket of a game that is
  // over may be unknown soon.
  void lose(SeatIterator seat, const std::string& error) {
    if (!seat->over) {
      if (seat->ticket == ticket_) throw Failure(error);
      seat->error = error;
    }
    finished_.splice(finished_.end(), seats_, seat);
  }

  const Server& server_;
  const Choose choose_;
  const std::string ticket_;
  std::list<Seat> seats_;
  std::list<Seat> finished_;
  std::optional<uint32_t> participant_;
  // Of this stream: commands to be sent, and why to continue on another one.
  v1::PlayRequest commands_;
  grpc::Status refused_;
};
