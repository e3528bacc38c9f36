-- Studies and what changed them. The blobs are described in the folder form/; the games are stored with all games.

CREATE TABLE studies (
    -- Numbered in the order in which they were created.
    number INTEGER PRIMARY KEY,
    study_id BLOB NOT NULL UNIQUE,
    -- Version of the form of the blobs.
    form INTEGER NOT NULL,
    header BLOB NOT NULL
);

-- Each row has the changes of one commit, numbered from 0 in its study.
CREATE TABLE study_changes (
    study INTEGER NOT NULL REFERENCES studies (number),
    position INTEGER NOT NULL,
    changes BLOB NOT NULL,
    PRIMARY KEY (study, position)
) WITHOUT ROWID;

-- Interface traces of participants.
CREATE TABLE study_traces (
    number INTEGER PRIMARY KEY,
    study INTEGER NOT NULL REFERENCES studies (number),
    participant INTEGER NOT NULL,
    game_id BLOB NOT NULL,
    traces BLOB NOT NULL
);

CREATE INDEX study_traces_by_participant ON study_traces (study, participant);
