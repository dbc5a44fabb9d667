"""The proof: trials sealed before, diagnosed by processes that cannot know, opened and scored after.

`seal` draws trials and publishes their hashes in a ledger, `run` has each campaign diagnosed by a process
that is given nothing else, `reveal` checks every hash and scores. `folder` says what lies where.
"""
