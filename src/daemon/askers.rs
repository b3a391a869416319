//! Who waits for what was asked of a gimbal.

use tokio::sync::oneshot;

use crate::gimbals::operation::OperationId;
use crate::manager::asked::Answer;

/// Those who wait; few, because the core does few things at once.
#[derive(Debug, Default)]
pub struct Askers {
    next: u64,
    waiting: Vec<(OperationId, oneshot::Sender<Answer>)>,
}

impl Askers {
    /// The id under which the core is to answer.
    pub fn wait(&mut self, answer: oneshot::Sender<Answer>) -> OperationId {
        let id = OperationId(self.next);
        self.next += 1;
        self.waiting.push((id, answer));
        id
    }

    pub fn answer(&mut self, id: OperationId, answer: Answer) {
        if let Some(at) = self.waiting.iter().position(|(waiting, _)| *waiting == id) {
            // Who has given up waiting is gone.
            drop(self.waiting.swap_remove(at).1.send(answer));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manager::asked::NotDone;

    #[test]
    fn each_gets_its_own_answer_and_who_is_gone_none() {
        let mut askers = Askers::default();
        let (asked, mut answers): (Vec<_>, Vec<_>) = (0..3).map(|_| oneshot::channel()).unzip();
        let ids: Vec<OperationId> = asked.into_iter().map(|asker| askers.wait(asker)).collect();
        drop(answers.remove(1));

        askers.answer(ids[2], Err(NotDone::TooMuch));
        askers.answer(ids[1], Ok(()));
        askers.answer(ids[0], Ok(()));
        askers.answer(ids[0], Err(NotDone::Ending));

        assert_eq!(answers[0].try_recv(), Ok(Ok(())));
        assert_eq!(answers[1].try_recv(), Ok(Err(NotDone::TooMuch)));
        assert!(askers.waiting.is_empty());
    }
}
