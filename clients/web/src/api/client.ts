// The one connection to the server this page came from, and a typed client for each of its services (gRPC-web over the page's own
// origin). What went wrong in a call is said in faults.ts.

import { createClient } from "@connectrpc/connect";
import { createGrpcWebTransport } from "@connectrpc/connect-web";
import { PlayService } from "../gen/chefshat/v1/play_service_pb";
import { RecordService } from "../gen/chefshat/v1/record_service_pb";
import { RoomService } from "../gen/chefshat/v1/room_service_pb";
import { ServerService } from "../gen/chefshat/v1/server_service_pb";
import { SpectatorService } from "../gen/chefshat/v1/spectator_service_pb";
import { TournamentService } from "../gen/chefshat/v1/tournament_service_pb";

const transport = createGrpcWebTransport({ baseUrl: location.origin });

/** The server itself: version, limits, built-in agents, texts of actions. */
export const serverApi = createClient(ServerService, transport);
/** Making, finding and joining rooms. */
export const roomApi = createClient(RoomService, transport);
/** Playing: `watch` streams what seats are told, `act` does something for one. */
export const playApi = createClient(PlayService, transport);
/** Watching without a seat. */
export const spectatorApi = createClient(SpectatorService, transport);
/** Records of finished games. */
export const recordApi = createClient(RecordService, transport);
/** Tournaments, their results, the leaderboard. */
export const tournamentApi = createClient(TournamentService, transport);

/** Milliseconds after which a call that is answered at once normally is given up; streams have no such limit. */
export const CALL_LIMIT_MS = 15_000;
