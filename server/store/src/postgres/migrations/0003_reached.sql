-- Whether another node has reached a node since it joined, or there was none: only then it takes something over. Nodes of
-- earlier versions are not asked.
ALTER TABLE nodes ADD COLUMN reached boolean NOT NULL DEFAULT true;
