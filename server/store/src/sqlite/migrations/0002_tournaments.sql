-- Tournaments and what moved them. What the blobs hold is written in the folder form/; where their games stand is kept with the games.

CREATE TABLE tournaments (
    -- Numbered in the order in which they were made.
    number INTEGER PRIMARY KEY,
    tournament_id BLOB NOT NULL UNIQUE,
    -- Version of the form of the blobs.
    form INTEGER NOT NULL,
    -- Whether it has been played to its end or closed.
    over INTEGER NOT NULL DEFAULT 0,
    header BLOB NOT NULL
);

CREATE INDEX tournaments_by_end ON tournaments (over, number);

-- Each row is what was kept at a time, numbered from 0 in its tournament.
CREATE TABLE tournament_entries (
    tournament INTEGER NOT NULL REFERENCES tournaments (number),
    position INTEGER NOT NULL,
    entries BLOB NOT NULL,
    PRIMARY KEY (tournament, position)
) WITHOUT ROWID;
