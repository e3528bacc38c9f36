-- Nodes, what they own, games with their journals, tournaments. What the blobs contain is in the folder form/.

-- The oldest schema whose programs can use this one. A migration that only adds leaves it as it is, so that nodes of
-- the version before keep running; one that removes or changes something raises it.
CREATE TABLE schema_support (oldest bigint NOT NULL);
INSERT INTO schema_support VALUES (1);

-- The time by which leases are judged, milliseconds since the Unix epoch.
CREATE FUNCTION clock_ms() RETURNS bigint VOLATILE LANGUAGE sql
    AS 'SELECT floor(extract(epoch FROM clock_timestamp()) * 1000)::bigint';

CREATE TABLE nodes (
    node bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    name text NOT NULL,
    -- Where other nodes and clients reach it.
    peer_endpoint text NOT NULL,
    client_endpoint text NOT NULL,
    build text NOT NULL,
    capacity bigint NOT NULL,
    beat_ms bigint NOT NULL,
    -- Whether somebody has asked it to hand over what it owns.
    drain boolean NOT NULL DEFAULT false
);

-- Rooms and tournaments, those that are over for a while.
CREATE TABLE owned (
    -- The id of the room or tournament.
    id bytea PRIMARY KEY,
    -- What changes hands together: the id of the tournament, or of the room alone. All rows of a unit have the same
    -- node and epoch.
    unit bytea NOT NULL,
    -- 0: a room, 1: a tournament.
    kind smallint NOT NULL,
    -- NULL: nobody owns it.
    node bigint REFERENCES nodes ON DELETE SET NULL,
    epoch bigint NOT NULL,
    join_code text NOT NULL,
    -- The game of a room.
    game_id bytea,
    -- Whether it survives its node.
    durable boolean NOT NULL,
    -- Which programs can resume it: the form of its blobs, and the rules of its game.
    form bigint NOT NULL,
    rules_version bigint,
    over boolean NOT NULL DEFAULT false,
    ended_ms bigint
);

CREATE UNIQUE INDEX owned_by_open_code ON owned (join_code) WHERE NOT over;
CREATE INDEX owned_by_code ON owned (join_code);
CREATE INDEX owned_by_node ON owned (node) WHERE NOT over;
CREATE INDEX owned_by_unit ON owned (unit);
CREATE INDEX owned_by_end ON owned (ended_ms) WHERE over AND kind = 0;

CREATE TABLE games (
    number bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    game_id bytea NOT NULL UNIQUE,
    -- Version of the form of the blobs.
    form bigint NOT NULL,
    -- 0 while it is not over, else the number of its chefshat.v1.RoomState.
    state integer NOT NULL,
    -- Milliseconds since the Unix epoch; of an imported game, the time of the import.
    ended_at_ms bigint,
    -- Whether the record has been written to a file.
    filed boolean NOT NULL DEFAULT false,
    -- By what a finished game is looked for: parts of its summary, and whether it was played elsewhere.
    origin integer,
    room_name text,
    created_at_ms bigint,
    added boolean NOT NULL DEFAULT false,
    -- chefshat.v1.RecordSummary of a finished game in which something was dealt.
    summary bytea,
    -- NULL for a game that was played elsewhere.
    header bytea,
    -- Number in the list of finished games, in the order in which their ends were committed; NULL if it is not in it.
    listed bigint UNIQUE,
    signature bytea
);

CREATE INDEX games_given_up ON games (ended_at_ms) WHERE state <> 0 AND summary IS NULL;
CREATE INDEX games_unfiled ON games (number) WHERE NOT filed AND summary IS NOT NULL;

-- The last number of the list. Whoever ends a game locks this row until the end is committed: the numbers of a sequence
-- would become visible out of order.
CREATE TABLE finished (last bigint NOT NULL);
INSERT INTO finished VALUES (0);

-- What one room committed at a time.
CREATE TABLE journal (
    game bigint NOT NULL,
    -- From 0, without gaps.
    position bigint NOT NULL,
    -- The epoch of its writer.
    epoch bigint NOT NULL,
    entries bytea NOT NULL,
    PRIMARY KEY (game, position)
);

-- Records of games that were played elsewhere.
CREATE TABLE added_records (
    game bigint PRIMARY KEY,
    record bytea NOT NULL
);

-- Who took part in finished games, for looking for them.
CREATE TABLE participants (
    game bigint NOT NULL,
    seat bigint NOT NULL,
    name text NOT NULL,
    -- Name of the built-in agent, or empty.
    agent text NOT NULL,
    kind integer NOT NULL,
    PRIMARY KEY (game, seat)
);

CREATE INDEX participants_by_name ON participants (name, game);
CREATE INDEX participants_by_agent ON participants (agent, game);

CREATE TABLE tournaments (
    number bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    tournament_id bytea NOT NULL UNIQUE,
    form bigint NOT NULL,
    over boolean NOT NULL DEFAULT false,
    header bytea NOT NULL
);

CREATE INDEX tournaments_by_end ON tournaments (over, number);

-- What one tournament committed at a time, from 0.
CREATE TABLE tournament_entries (
    tournament bigint NOT NULL,
    position bigint NOT NULL,
    epoch bigint NOT NULL,
    entries bytea NOT NULL,
    PRIMARY KEY (tournament, position)
);
