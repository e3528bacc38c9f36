// The connection to the server that served this page, with a typed client for each service
// (gRPC-web over the page's origin). Errors are put into words in faults.ts.

import { createClient, type Transport } from "@connectrpc/connect";
import { createGrpcWebTransport } from "@connectrpc/connect-web";
import { AnalysisService } from "../gen/chefshat/v1/analysis_service_pb";
import { PlayService } from "../gen/chefshat/v1/play_service_pb";
import { RecordService } from "../gen/chefshat/v1/record_service_pb";
import { RoomService } from "../gen/chefshat/v1/room_service_pb";
import { ServerService } from "../gen/chefshat/v1/server_service_pb";
import { SpectatorService } from "../gen/chefshat/v1/spectator_service_pb";
import { TableService } from "../gen/chefshat/v1/table_service_pb";
import { TournamentService } from "../gen/chefshat/v1/tournament_service_pb";
import { askHeartbeats } from "./follow";
import { repeat } from "./repeat";
import { showSecrets } from "./secrets";
import { authorize } from "./token";

/** Deadline of a unary call that sets none itself, milliseconds. Streams have none. */
const CALL_LIMIT_MS = 15_000;

const grpcWeb = createGrpcWebTransport({
  baseUrl: location.origin,
  interceptors: [repeat, authorize, showSecrets, askHeartbeats],
});

/** gRPC-web to the origin of the page. */
export const transport: Transport = {
  stream: grpcWeb.stream,
  unary: (method, signal, timeoutMs = CALL_LIMIT_MS, ...rest) => grpcWeb.unary(method, signal, timeoutMs, ...rest),
};

/** The server itself: version, limits, built-in agents, texts of actions. */
export const serverApi = createClient(ServerService, transport);
/** Creating, finding and joining rooms. */
export const roomApi = createClient(RoomService, transport);
/** Playing: `watch` streams a seat's updates, `act` acts for a seat. */
export const playApi = createClient(PlayService, transport);
/** Watching without a seat. */
export const spectatorApi = createClient(SpectatorService, transport);
/** Reporting about a physical table, and following its state. */
export const tableApi = createClient(TableService, transport);
/** Records of finished games. */
export const recordApi = createClient(RecordService, transport);
/** Estimates of the actions of a decision. */
export const analysisApi = createClient(AnalysisService, transport);
/** Tournaments, their results, the leaderboard. */
export const tournamentApi = createClient(TournamentService, transport);
