-- Games and their journals. What the blobs hold is written in the folder form/; everything else about a game follows from them.

-- "ChHt": tells this database from those of other programs.
PRAGMA application_id = 0x43684874;

CREATE TABLE games (
    -- Numbered in the order in which they were made.
    number INTEGER PRIMARY KEY,
    game_id BLOB NOT NULL UNIQUE,
    -- Version of the form of the blobs.
    form INTEGER NOT NULL,
    -- 0 while the game goes on, else the number of its chefshat.v1.RoomState.
    state INTEGER NOT NULL,
    -- Milliseconds since the Unix epoch; NULL while it goes on.
    ended_at_ms INTEGER,
    -- Whether the record has been written to a file.
    filed INTEGER NOT NULL DEFAULT 0,
    -- By what a finished game is looked for: parts of its summary, and whether it was played elsewhere.
    origin INTEGER,
    room_name TEXT,
    created_at_ms INTEGER,
    added INTEGER NOT NULL DEFAULT 0,
    -- chefshat.v1.RecordSummary of a finished game in which something was dealt.
    summary BLOB,
    -- What stood before the game began; NULL for a game that was played elsewhere.
    header BLOB,
    -- No row of its journal comes before this one.
    first_row INTEGER,
    -- The last row of its journal; NULL while it goes on.
    last_row INTEGER
);

CREATE INDEX games_going_on ON games (number) WHERE state = 0;
CREATE INDEX games_given_up ON games (number) WHERE state <> 0 AND summary IS NULL;
CREATE INDEX games_by_end ON games (ended_at_ms);
CREATE INDEX games_unfiled ON games (number) WHERE filed = 0 AND summary IS NOT NULL;

-- What happened, each row what one room kept at a time. The rows of all games stand in the order in which they were kept, so that what many
-- rooms keep at once goes into one page of the file, not into one for each; the rows of a game are found from the last to the first.
CREATE TABLE journal (
    row INTEGER PRIMARY KEY,
    game INTEGER NOT NULL,
    -- Number of the row in its game, from 0.
    position INTEGER NOT NULL,
    -- The row of the game before this one; NULL for its first.
    previous INTEGER,
    entries BLOB NOT NULL
);

-- Records of games that were played elsewhere.
CREATE TABLE added_records (
    game INTEGER PRIMARY KEY REFERENCES games (number),
    record BLOB NOT NULL
);

-- Who took part in finished games, for looking for them.
CREATE TABLE participants (
    game INTEGER NOT NULL REFERENCES games (number),
    seat INTEGER NOT NULL,
    name TEXT NOT NULL,
    -- Name of the built-in agent, or empty.
    agent TEXT NOT NULL,
    kind INTEGER NOT NULL,
    PRIMARY KEY (game, seat)
) WITHOUT ROWID;

CREATE INDEX participants_by_name ON participants (name, game);
CREATE INDEX participants_by_agent ON participants (agent, game);
