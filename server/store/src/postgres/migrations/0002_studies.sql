-- The room of a running game.
CREATE INDEX owned_by_game ON owned (game_id) WHERE NOT over;

-- A study is a unit in `owned` like a tournament, of kind 2. It is never over, and its join_code is nothing that can be
-- typed as a code.
CREATE TABLE studies (
    number bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    study_id bytea NOT NULL UNIQUE,
    form bigint NOT NULL,
    header bytea NOT NULL
);

-- What one study committed at a time, from 0.
CREATE TABLE study_changes (
    study bigint NOT NULL,
    position bigint NOT NULL,
    epoch bigint NOT NULL,
    changes bytea NOT NULL,
    PRIMARY KEY (study, position)
);

-- Interface traces of participants.
CREATE TABLE study_traces (
    number bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    -- Drawn by the writer, so that traces are added once.
    trace_id bytea NOT NULL UNIQUE,
    study bigint NOT NULL,
    participant bigint NOT NULL,
    game_id bytea NOT NULL,
    traces bytea NOT NULL
);

CREATE INDEX study_traces_by_participant ON study_traces (study, participant);
