// An agent without an SDK: it joins a room or a tournament and takes a random legal action at every
// decision. It contains no rules of the game. With its ticket another process can resume its seat.
// It runs on Linux and other Unix systems.

#include <fcntl.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cctype>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <iomanip>
#include <map>
#include <sstream>
#include <vector>

#include "chefshat/v1/room_service.grpc.pb.h"
#include "chefshat/v1/tournament_service.grpc.pb.h"
#include "player.h"

namespace {

// The options of the command line, with their values.
using Options = std::map<std::string, std::string>;

// Maximum number of attempts to join, and the time for each.
constexpr int MAX_JOINS = 8;
constexpr std::chrono::seconds JOIN_TIME{30};

// Chooses an action, the index of a set bit of the mask. Change this to play better:
// `request.observation()` is what the seat knows.
uint32_t choose(const v1::DecisionRequest& request, std::mt19937_64& random) {
  const std::string& mask = request.action_mask();
  std::vector<uint32_t> legal;
  for (uint32_t action = 0; action < mask.size() * 8; ++action) {
    if ((mask[action / 8] >> (action % 8)) & 1) legal.push_back(action);
  }
  return legal.at(std::uniform_int_distribution<size_t>(0, legal.size() - 1)(random));
}

Options parse(int count, char** arguments) {
  const auto environment = [](const char* name) -> std::string {
    const char* value = std::getenv(name);
    return value == nullptr ? "" : value;
  };
  Options options{{"--address", "127.0.0.1:50051"},
                  {"--ca", environment("CHEFSHAT_CA")},
                  {"--code", ""},
                  {"--games", "1"},
                  {"--name", "C++"},
                  {"--seed", std::to_string(std::random_device{}())},
                  {"--ticket", environment("CHEFSHAT_TICKET")},
                  {"--ticket-file", ""},
                  {"--token", environment("CHEFSHAT_TOKEN")},
                  {"--tournament", ""}};
  for (int i = 1; i < count; i += 2) {
    const auto option = options.find(arguments[i]);
    if (option == options.end() || i + 1 == count) {
      std::string known;
      for (const auto& [name, value] : options) known += " [" + name + " VALUE]";
      throw Failure("usage: agent" + known);
    }
    option->second = arguments[i + 1];
  }
  const auto given = [&](const char* option) { return !options.at(option).empty(); };
  if (given("--ticket") + given("--code") + given("--tournament") > 1 ||
      (given("--ticket") && given("--ticket-file"))) {
    throw Failure("give one of --code, --tournament and --ticket; --ticket-file excludes --ticket");
  }
  if (!given("--code") && !given("--tournament")) options["--code"] = environment("CHEFSHAT_CODE");
  return options;
}

uint32_t number(const Options& options, const std::string& option) {
  std::istringstream text(options.at(option));
  uint32_t value = 0;
  if (std::isdigit(text.peek()) && text >> value && text.eof()) return value;
  throw Failure(option + " must be a number");
}

// A request to join with a code. A call that is repeated after a lost response has the same request
// id, which nobody can guess, and takes no second seat.
template <class Request>
Request request_with(const std::string& code, const Options& options) {
  Request request;
  request.set_join_code(code);
  request.set_name(options.at("--name"));
  std::random_device random;
  std::string& id = *request.mutable_request_id();
  while (id.size() < 32) id.push_back(static_cast<char>(random()));
  return request;
}

// Joins a room or a tournament. Returns the ticket.
std::string join(const Server& server, const Options& options) {
  if (const std::string& tournament = options.at("--tournament"); !tournament.empty()) {
    auto request = request_with<v1::JoinTournamentRequest>(tournament, options);
    request.set_max_games(number(options, "--games"));
    v1::JoinTournamentResponse response;
    const auto stub = v1::TournamentService::NewStub(server.channel);
    server.call(MAX_JOINS, [&](grpc::ClientContext* context) {
      context->set_deadline(std::chrono::system_clock::now() + JOIN_TIME);
      return stub->JoinTournament(context, request, &response);
    });
    return response.ticket();
  }
  const std::string& code = options.at("--code");
  if (code.empty()) throw Failure("give --code, --tournament or --ticket");
  const auto request = request_with<v1::JoinRoomRequest>(code, options);
  v1::JoinRoomResponse response;
  const auto stub = v1::RoomService::NewStub(server.channel);
  server.call(MAX_JOINS, [&](grpc::ClientContext* context) {
    context->set_deadline(std::chrono::system_clock::now() + JOIN_TIME);
    return stub->JoinRoom(context, request, &response);
  });
  return response.ticket();
}

// Locks a file that only its owner can read until the process ends, so that another agent does not
// use the same ticket.
void lock(const std::string& path) {
  struct stat about = {};
  while (about.st_nlink == 0) {  // Again if the agent that has just ended removed the file.
    const int file = open(path.c_str(), O_RDONLY | O_CREAT | O_CLOEXEC, S_IRUSR | S_IWUSR);
    if (file < 0) throw Failure("cannot open " + path + ": " + std::strerror(errno));
    if (flock(file, LOCK_EX | LOCK_NB) != 0) throw Failure("another agent uses " + path);
    fstat(file, &about);
  }
}

// The ticket that is given or stored, or a new one, which is stored or printed.
std::string ticket_of(const Server& server, const Options& options) {
  const std::string& path = options.at("--ticket-file");
  std::string ticket = options.at("--ticket");
  if (!path.empty()) lock(path);
  if (std::ifstream(path) >> ticket) {
    std::cerr << "resuming with the ticket in " << path << std::endl;
  } else if (ticket.empty()) {
    try {
      ticket = join(server, options);
    } catch (...) {
      unlink(path.c_str());  // It is empty.
      throw;
    }
    std::cerr << "if this process ends early, resume ";
    if (std::ofstream(path) << ticket << std::endl) {
      std::cerr << "by the same command: the ticket is in " << path << std::endl;
    } else {
      std::cerr << "with --ticket " << ticket << std::endl;
    }
  }
  return ticket;
}

// Prints how a game ended, or those of a tournament, as a line of JSON.
void print(const Player& player) {
  const auto participant = player.participant();
  const char* comma = "";
  if (participant) std::cout << "{\"participant\":" << *participant << ",\"games\":[";
  for (const Seat& seat : player.finished()) {
    if (!participant && !seat.error.empty()) throw Failure(seat.error);
    std::cout << comma << "{";
    comma = ",";
    if (participant) std::cout << "\"game_id\":" << std::quoted(seat.game_id) << ",";
    std::cout << "\"seat\":" << seat.number;
    const char* separator = ",\"standings\":[";
    for (const v1::Standing& line : seat.result.standings()) {
      std::cout << separator << "{\"seat\":" << line.seat() << ",\"points\":" << line.points()
                << ",\"place\":" << line.place() << "}";
      separator = ",";
    }
    if (seat.error.empty()) {
      std::cout << "]}";
    } else {
      std::cout << ",\"error\":" << std::quoted(seat.error) << "}";
    }
  }
  std::cout << (participant ? "]}" : "") << std::endl;
}

void run(const Options& options) {
  const Server server(options.at("--address"), options.at("--token"), options.at("--ca"));
  std::mt19937_64 random(number(options, "--seed"));
  const auto choose_at_random = [&](const auto& request) { return choose(request, random); };
  Player player(server, choose_at_random, ticket_of(server, options));
  player.play();
  unlink(options.at("--ticket-file").c_str());  // The ticket is used up.
  print(player);
}

// The ticket remains in its file.
void stop(int) {
  constexpr std::string_view text = "agent: stopped by a signal\n";
  [[maybe_unused]] const ssize_t written = write(STDERR_FILENO, text.data(), text.size());
  _exit(EXIT_FAILURE);
}

}  // namespace

int main(int count, char** arguments) {
  signal(SIGINT, stop);
  signal(SIGTERM, stop);
  try {
    run(parse(count, arguments));
    return EXIT_SUCCESS;
  } catch (const std::exception& error) {
    std::cerr << "agent: " << error.what() << std::endl;
    return EXIT_FAILURE;
  }
}
